"""JSON of an enemy: numbers, letters, nesting and forms."""

import pytest

from flocsim.io.json_text import matches, read_json


def test_what_fits_is_read():
    text = '{"type": "κ", "count": 3, "delta": 1, "more": [null, true]}'
    found = read_json(text, {"type": str, "count": int, "delta": float})
    assert found == {"type": "κ", "count": 3, "delta": 1, "more": [None, True]}
    assert read_json(b"[]", [{"a": str}]) == []


@pytest.mark.parametrize(
    "text",
    ["", "{", "[" * 100_000, "9" * 5000, b"\xff", 7, None],
)
def test_what_is_no_sound_json_is_refused_in_one_line(text):
    with pytest.raises(ValueError) as caught:
        read_json(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("value", "pattern"),
    [([], {}), ({}, []), ([1], [str]), ({"a": 1}, {"a": str}), ({}, {"a": object}), (True, int),
     (True, float), (1.5, int), ("1", float), ({"a": [{}]}, {"a": [{"b": int}]})],
)  # fmt: skip
def test_other_forms_are_told(value, pattern):
    assert not matches(value, pattern)
