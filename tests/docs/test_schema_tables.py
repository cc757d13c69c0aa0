"""docs/config.md, results.md and commands.md say what the schemas and the parser do."""

import importlib.util
import tomllib

import pytest

from flocsim.ensembles.config.schema import FORCES, TABLES, keys_of
from flocsim.io.results.file import SCHEMA_VERSION
from flocsim.io.results.schema import REPLICATES
from tests.helpers.small_study import ROOT


@pytest.fixture(scope="module")
def tables():
    """The module that makes the parts of the pages."""
    path = ROOT / "docs" / "schema_tables.py"
    spec = importlib.util.spec_from_file_location("schema_tables", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["config.md", "results.md", "commands.md"])
def test_the_pages_get_all_parts_of_the_schema(tables, name):
    page = (ROOT / "docs" / name).read_text("utf-8")
    parts = tables.PAGES[name]()
    made = tables.with_parts(page, parts)
    assert all(part.strip() in made for part in parts.values())
    assert "<!-- from the schema" not in made


def test_the_page_of_results_has_the_version_and_every_column(tables):
    assert f"schema version {SCHEMA_VERSION};" in (ROOT / "docs" / "results.md").read_text("utf-8")
    assert all(f"`{name}`" in tables.results_parts()["replicates"] for name in REPLICATES)


def test_the_page_names_every_key(tables):
    page = tables.config_parts()["keys"]
    for table_class in [*TABLES.values(), *FORCES.values()]:
        assert all(f"| `{key}` |" in page for key in keys_of(table_class))


def test_the_pages_defaults_are_valid_toml(tables):
    rows = [
        line.split(" | ")
        for line in tables.config_parts()["keys"].split("\n")
        if line.startswith("| `")
    ]
    defaults = [cells[2] for cells in rows if len(cells) == 4 and cells[2].startswith("`")]
    assert len(defaults) > 20
    for default in defaults:
        tomllib.loads(f"key = {default.strip('`')}")
