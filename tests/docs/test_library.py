"""Every block of docs/library.md runs, one after the other, in an empty folder."""

import ast
import re
from pathlib import Path

import pytest

import flocsim

PAGE = Path(__file__).resolve().parents[2] / "docs" / "library.md"


def blocks():
    """The source of each, with as many lines above it as the page has: errors name its lines."""
    lines = PAGE.read_text("utf-8")
    found = list(re.finditer(r"```python\n(.*?)```", lines, re.DOTALL))
    assert len(found) > 8
    return ["\n" * lines[: block.start(1)].count("\n") + block[1] for block in found]


def test_every_block_is_python_of_names_that_flocsim_has():
    for block in blocks():
        tree = ast.parse(block, str(PAGE))
        wanted = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
        exec(compile(ast.Module(wanted, []), str(PAGE), "exec"), {})
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "flocsim":
                assert hasattr(flocsim, node.attr), f"line {node.lineno}: flocsim.{node.attr}"


@pytest.mark.slow
def test_every_block_runs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("xarray")
    pytest.importorskip("pandas")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "library"}
    for block in blocks():
        exec(compile(block, str(PAGE), "exec"), names)
    made = {path.name for path in tmp_path.iterdir()}
    assert {"a.h5", "b.h5", "sweep.h5", "a-4.png", "forces.png", "run.gif", "run.h5"} <= made
    assert names["swept"].to_xarray()["pr_a"].dims[0] == "hamaker"
    assert names["stopped"].status.name in capsys.readouterr().out
