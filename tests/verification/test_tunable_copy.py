"""The copy of the package with tuned constants: what reads the table, and what does not."""

import ast

from benchmarks.accuracy.tunable import NUMBER, Constant, Rewrite, all_constants, dependents

KNOWN = {("", "SAFETY"): (3, False), ("", "COUNT"): (4, True), ("sizes", "SKIN"): (5, False)}


def rewritten(source):
    """Return a source in which reads of KNOWN constants are replaced."""
    return ast.unparse(Rewrite(dict(KNOWN)).visit(ast.parse(source)))


def test_functions_read_the_table():
    assert rewritten("def f(h):\n    return SAFETY * h") == "def f(h):\n    return tuned(3) * h"
    assert rewritten("def f():\n    return sizes.SKIN") == "def f():\n    return tuned(5)"
    assert rewritten("f = lambda h: SAFETY * h") == "f = lambda h: tuned(3) * h"


def test_whole_numbers_stay_whole():
    assert "range(int(tuned(4)))" in rewritten("def f():\n    for k in range(COUNT):\n        pass")


def test_modules_defaults_and_local_names_stay():
    for source in (
        "HALF = SAFETY / 2",
        "def f(h=SAFETY):\n    return h",
        "def f(SAFETY):\n    return SAFETY",
        "def f():\n    SAFETY = 1.0\n    return SAFETY",
    ):
        assert rewritten(source) == source


def test_constants_of_the_engine_are_found_with_their_documentation():
    found = {each.key: each for each in all_constants()}
    safety = found["integrators.rhs.error.SAFETY"]
    assert (safety.kind, safety.value, safety.documented) == (NUMBER, 0.9, True)
    assert found["hooks.BODY_FORCE"].left_out
    assert found["integrators.explicit.NODES"].left_out


def test_expressions_follow_what_they_are_computed_from():
    texts = {"ONE": "2.0", "OTHER": "3.0 * ONE", "THIRD": "1.0"}
    made = [Constant("module", name, NUMBER, text, True, 1) for name, text in texts.items()]
    assert dependents(made) == {0: [1]}
