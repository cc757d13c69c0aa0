"""Every block of docs/library.md runs, one after the other, in an empty folder."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "library.md"


def test_every_block_runs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("xarray")
    pytest.importorskip("pandas")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "library"}
    lines = PAGE.read_text("utf-8")
    blocks = list(re.finditer(r"```python\n(.*?)```", lines, re.DOTALL))
    assert len(blocks) > 8
    for block in blocks:
        # Errors name the line of the page.
        above = "\n" * lines[: block.start(1)].count("\n")
        exec(compile(above + block[1], str(PAGE), "exec"), names)
    made = {path.name for path in tmp_path.iterdir()}
    assert {"a.h5", "b.h5", "sweep.h5", "a-4.png", "forces.png", "run.gif", "run.h5"} <= made
    assert names["swept"].to_xarray()["pr_a"].dims[0] == "hamaker"
    assert names["stopped"].status.name in capsys.readouterr().out
