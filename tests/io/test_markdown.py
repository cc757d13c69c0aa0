"""Markdown tables."""

from flocsim.io.markdown import markdown_table


def test_a_bar_in_a_cell_does_not_end_it():
    assert markdown_table(("a", "b"), [("x|y", 1)]) == "| a | b |\n| --- | --- |\n| x\\|y | 1 |"
