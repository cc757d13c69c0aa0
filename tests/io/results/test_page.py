"""docs/results.md is what the schema says."""

from flocsim.io.results.page import results_page
from flocsim.io.results.schema import REPLICATES
from tests.helpers.small_study import ROOT


def test_the_page_is_current():
    page = (ROOT / "docs" / "results.md").read_text("utf-8")
    assert page == results_page(), "run python -m flocsim.io.results.page > docs/results.md"


def test_the_page_names_every_column():
    assert all(f"`{name}`" in results_page() for name in REPLICATES)
