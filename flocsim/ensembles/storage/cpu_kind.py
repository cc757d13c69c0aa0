"""On what kind of CPU rows were computed: all that decides their last digits beside the code.

Compiled code is made for the CPU at hand (a fused multiply-add rounds once, where two operations
round twice), numpy and the C library choose among their own variants. On one kind of CPU a
replicate is the same bytes always; between kinds it may differ in its last digits, and a collision
that is close to a decision may end otherwise.
"""

from collections.abc import Iterator, Sequence

MOST_FEATURES = 4
"""Features by which a message tells two kinds apart."""


def distinct(kinds: Sequence[dict]) -> list[dict]:
    """Each kind once, in the order in which they come."""
    return [kind for place, kind in enumerate(kinds) if kind not in kinds[:place]]


def describe_kind(kind: dict, others: Sequence[dict] = ()) -> str:
    """A kind in words: its name, and what it has that one of the others has not."""
    words = [kind["cpu"]]
    if kind["compiled_for"] != kind["cpu"]:
        words.append(f"compiled for {kind['compiled_for']}")
    for name, title in (("features", ""), ("numpy", "numpy with "), ("libm", "")):
        own = [each for each in kind[name] if any(each not in other[name] for other in others)]
        if own:
            more = ", …" if len(own) > MOST_FEATURES else ""
            words.append(f"{title}{', '.join(own[:MOST_FEATURES])}{more}")
    return words[0] if len(words) == 1 else f"{words[0]} ({'; '.join(words[1:])})"


def mixture_warnings(path: object, found: Sequence[dict], now: Sequence[dict]) -> Iterator[str]:
    """Lines that warn of rows of several kinds in one file.

    ``found``: kinds of the rows that the file at ``path`` has already; ``now``: those of the ranks
    that add to them.
    """
    kinds = distinct([*found, *now])
    names = [describe_kind(kind, [each for each in kinds if each != kind]) for kind in kinds]
    end = "the file will have rows of both kinds, which may differ in their last digits"
    if len(now) > 1:
        here = " and ".join(names[kinds.index(kind)] for kind in now)
        yield f"the ranks run on different kinds of CPU, {here}: {end}"
    elif any(kind not in found for kind in now) and found:
        there = " and ".join(names[kinds.index(kind)] for kind in found)
        here = names[kinds.index(now[0])]
        yield f"{path} has rows of another kind of CPU, {there}, and this is {here}: {end}"
