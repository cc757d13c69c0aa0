"""docs/results.md is what the schema says."""

from flocsim.io.markdown import with_parts
from flocsim.io.results.layout import SCHEMA_VERSION
from flocsim.io.results.page import results_parts
from flocsim.io.results.schema import REPLICATES
from tests.helpers.small_study import ROOT


def test_the_page_is_current():
    page = (ROOT / "docs" / "results.md").read_text("utf-8")
    command = "python -m flocsim.io.results.page docs/results.md"
    assert page == with_parts(page, results_parts()), f"run {command}"
    assert f"schema version {SCHEMA_VERSION};" in page


def test_the_page_names_every_column():
    assert all(f"`{name}`" in results_parts()["replicates"] for name in REPLICATES)
