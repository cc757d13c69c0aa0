"""docs/results.md is what the schema says."""

from small_study import ROOT

from flocsim.io.results_page import results_page
from flocsim.io.results_schema import REPLICATES


def test_the_page_is_current():
    page = (ROOT / "docs" / "results.md").read_text("utf-8")
    assert page == results_page(), "run python -m flocsim.io.results_page > docs/results.md"


def test_the_page_names_every_column():
    assert all(f"`{name}`" in results_page() for name in REPLICATES)
