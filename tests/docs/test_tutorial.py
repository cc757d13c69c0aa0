"""docs/tutorial.md and its notebook say the same, and every cell of it runs."""

import importlib.util
import os
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


def module():
    spec = importlib.util.spec_from_file_location("notebook", DOCS / "tutorial_notebook.py")
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def test_the_notebook_is_the_page():
    made = module().notebook((DOCS / "tutorial.md").read_text("utf-8"))
    kept = (DOCS / "tutorial.ipynb").read_text("utf-8")
    assert kept == made, "run: python docs/tutorial_notebook.py > docs/tutorial.ipynb"


@pytest.mark.slow
def test_every_cell_runs(tmp_path, environment):
    nbformat = pytest.importorskip("nbformat", reason="needs flocsim[docs]")
    nbclient = pytest.importorskip("nbclient", reason="needs flocsim[docs]")
    pytest.importorskip("ipykernel", reason="needs flocsim[docs]")
    # `!flocsim` has to be that of this Python.
    environment["PATH"] = str(Path(sys.executable).parent) + os.pathsep + environment["PATH"]
    whole = nbformat.read(DOCS / "tutorial.ipynb", as_version=4)
    nbformat.validate(whole)
    client = nbclient.NotebookClient(
        whole, timeout=900, resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    assert {"study.toml", "study.h5", "study.html", "weaker.h5", "strip.png"} <= {
        path.name for path in tmp_path.iterdir()
    }
    said = "".join(output.get("text", "") for cell in whole.cells if cell.cell_type == "code"
                   for output in cell.outputs)  # fmt: skip
    assert "N = 16: Pr[A] = " in said and "FINISHED" in said
