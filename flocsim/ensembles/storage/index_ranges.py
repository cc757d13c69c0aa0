"""Sets of whole numbers as sorted, disjoint intervals [first, stop)."""


def merged(intervals):
    """The union."""
    union = []
    for first, stop in sorted(intervals):
        if union and first <= union[-1][1]:
            union[-1] = (union[-1][0], max(stop, union[-1][1]))
        elif first < stop:
            union.append((first, stop))
    return union


def missing(intervals, first, stop):
    """What a union leaves out of [first, stop)."""
    gaps, place = [], first
    for start, end in intervals:
        if start >= stop:
            break
        if start > place:
            gaps.append((place, start))
        place = max(place, end)
    if place < stop:
        gaps.append((place, stop))
    return gaps


def total(intervals):
    """How many numbers there are."""
    return sum(stop - first for first, stop in intervals)
