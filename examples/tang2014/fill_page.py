"""Put the numbers and figures of a finished study into docs/reproduction.md.

    python examples/tang2014/fill_page.py [--draw] DIR

Every part ``<!-- name -->`` … ``<!-- end -->`` of the page is replaced by that of the same name in
DIR's summary.md; parts without one stay. Figures that the page shows,
figures/tang2014-NAME, are copied from DIR/NAME. The words around them are for a person to check.
--draw first makes summary.md and the figures anew from the results in DIR, running nothing.
"""

import argparse
import re
import shutil
import tomllib
from pathlib import Path

import reproduce

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reproduction.md"
SOURCE = "summary.md"
PART = re.compile(r"<!-- ([a-z-]+) -->\n.*?<!-- end -->", re.DOTALL)
FIGURE = re.compile(r"\(figures/tang2014-([\w.-]+)\)")


def parts_of(folder):
    """{name: part with its marks} of the summary in a folder."""
    text = (folder / SOURCE).read_text("utf-8")
    return {match[1]: match[0] for match in PART.finditer(text)}


def filled(text, parts):
    """The page's text with the known parts replaced."""
    return PART.sub(lambda match: parts.get(match[1], match[0]), text)


def copy_figures(text, folder, target):
    """Copy the figures of the page that the folder has; their names."""
    names = [name for name in FIGURE.findall(text) if (folder / name).exists()]
    for name in names:
        shutil.copyfile(folder / name, target / f"tang2014-{name}")
    return names


def draw(folder):
    """Make the figures of the results and summary.md anew."""
    import pages

    from flocsim.ensembles import load_config

    names = ["tang2014", *tomllib.loads(reproduce.READINGS.read_text("utf-8"))]
    files = {name: reproduce.reading_file(folder, name) for name in names}
    readings = {name: path for name, path in files.items() if path.exists()}
    pages.write(folder, load_config(reproduce.STUDY), readings)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--draw", action="store_true", help="make summary and figures anew first")
    arguments = parser.parse_args()
    folder = arguments.folder
    if arguments.draw:
        draw(folder)
    parts = parts_of(folder)
    text = PAGE.read_text("utf-8")
    PAGE.write_text(filled(text, parts), "utf-8")
    wanted = [match[1] for match in PART.finditer(text)]
    print("filled:", ", ".join(name for name in wanted if name in parts))
    print("as before:", ", ".join(name for name in wanted if name not in parts))
    print("copied:", ", ".join(copy_figures(text, folder, PAGE.parent / "figures")))


if __name__ == "__main__":
    main()
