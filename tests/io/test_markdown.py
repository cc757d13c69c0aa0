"""Markdown tables."""

import pytest

from flocsim.errors import UsageError
from flocsim.io.markdown import markdown_table, with_parts


def test_a_bar_in_a_cell_does_not_end_it():
    assert markdown_table(("a", "b"), [("x|y", 1)]) == "| a | b |\n| --- | --- |\n| x\\|y | 1 |"


PAGE = "Words.\n\n<!-- of the schema: a -->\n\nold\n\n<!-- end -->\n\nMore \\1.\n"


def test_parts_of_a_page_are_made_anew_and_words_stay():
    new = with_parts(PAGE, {"a": "| new \\1 |\n| two |\n"})
    assert new == PAGE.replace("old", "| new \\1 |\n| two |")
    assert with_parts(new, {"a": "old"}) == PAGE


@pytest.mark.parametrize("parts", [{}, {"b": ""}, {"a": "", "b": ""}])
def test_a_page_of_other_parts_is_refused(parts):
    with pytest.raises(UsageError, match="other parts"):
        with_parts(PAGE, parts)
