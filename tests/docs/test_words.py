"""Pages stay short: at most so many words for users, for developers, and of changes."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOR_DEVELOPERS = ["docs/engine.md"]
REPRODUCTION = "docs/reproduction.md"
"""Mostly tables, which a script fills."""


def words(*texts):
    return sum(len(text.split()) for text in texts)


def words_and_numbers(text):
    """Return how many there are, without the bars and dashes of tables."""
    return sum(any(map(str.isalnum, word)) for word in text.split())


def read(*patterns):
    return [path.read_text("utf-8") for each in patterns for path in ROOT.glob(each)]


def test_pages_for_users():
    pages = read("README.md", "docs/*.md", "docs/api/*.md")
    assert words(*pages) - words(*read(*FOR_DEVELOPERS, REPRODUCTION)) <= 20_000
    assert words(*read(REPRODUCTION)) <= 3_000


def test_pages_of_evidence():
    assert sum(map(words_and_numbers, read("docs/evidence/*.md"))) <= 12_000


@pytest.mark.parametrize(("page", "most"), [("ARCHITECTURE.md", 2500), ("CONTRIBUTING.md", 1500)])
def test_pages_for_developers(page, most):
    assert words(*read(page)) <= most


def test_changes():
    [changes] = read("CHANGELOG.md")
    _, unreleased, *before = changes.split("\n## ")
    assert words(unreleased) <= 600
    assert words(*before) <= 300
