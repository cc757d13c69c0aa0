"""docs/tutorial.md as a notebook: `python docs/tutorial_notebook.py > docs/tutorial.ipynb`.

Blocks of Python are cells, blocks of shell are cells with `!` before every line, the rest is text.
"""

import json
import re
from pathlib import Path

PAGE = Path(__file__).resolve().parent / "tutorial.md"
BLOCK = re.compile(r"```(python|sh)\n(.*?)```", re.DOTALL)


def cell(number, kind, source):
    lines = source.strip("\n").splitlines(keepends=True)
    made = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": lines}
    return made | ({"execution_count": None, "outputs": []} if kind == "code" else {})


def notebook(page):
    """The text of the notebook of a page."""
    # Other pages are not beside a notebook that was downloaded: their links become words.
    text = re.sub(r"\[([^\]]*)\]\((?!http)[^)]*\)", r"\1", page)
    pieces, end = [], 0
    for block in BLOCK.finditer(text):
        pieces.append(("markdown", text[end : block.start()]))
        code = block[2] if block[1] == "python" else re.sub("(?m)^(?=.)", "!", block[2])
        pieces.append(("code", code))
        end = block.end()
    pieces.append(("markdown", text[end:]))
    cells = [cell(n, *piece) for n, piece in enumerate(p for p in pieces if p[1].strip())]
    about = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
             "language_info": {"name": "python"}}  # fmt: skip
    whole = {"cells": cells, "metadata": about, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    print(notebook(PAGE.read_text("utf-8")), end="")
