"""Handing out: every replicate once, whoever asks, however much is given back; and intervals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flocsim.ensembles.kind import MOST_ROWS, merged, missing, total
from flocsim.ensembles.parallel.schedule import (
    Phase,
    Schedule,
    StudyState,
    TooManyFailures,
)
from tests.helpers.study_state import make_state, result_of

INTERVALS = st.lists(
    st.tuples(st.integers(0, 30), st.integers(0, 10)).map(lambda pair: (pair[0], sum(pair)))
)


def numbers(intervals):
    """The numbers in intervals, each as often as it is there."""
    return [number for first, stop in intervals for number in range(first, stop)]


@given(INTERVALS)
def test_a_union_has_each_number_once_in_order(intervals):
    assert numbers(merged(intervals)) == sorted(set(numbers(intervals)))
    assert total(merged(intervals)) == len(set(numbers(intervals)))


@given(INTERVALS, st.integers(0, 20), st.integers(0, 30))
def test_what_is_missing_and_what_is_there_make_the_whole(intervals, first, length):
    union, stop = merged(intervals), first + length
    gaps = numbers(missing(union, first, stop))
    there = [number for number in numbers(union) if first <= number < stop]
    assert sorted([*gaps, *there]) == list(range(first, stop))


@given(
    st.lists(INTERVALS, min_size=1, max_size=4), st.integers(1, 9), st.integers(1, 40),
    st.integers(0, 10**6),
)  # fmt: skip
def test_what_is_missing_is_handed_out_once(done, size, replicates, seed):
    rng = np.random.default_rng(seed)
    done = [missing(missing(merged(each), 0, replicates), 0, replicates) for each in done]
    borders = sorted({replicates // 3 or 1, replicates // 2 or 1, replicates})
    schedule = Schedule.of(done, borders, size)
    todo = {(c, k) for c, each in enumerate(done) for k in range(replicates)}
    todo -= {(c, k) for c, each in enumerate(done) for k in numbers(each)}
    assert schedule.remaining == len(todo)
    held, run, ended = [], [], list(schedule.finished_stages())
    while True:
        while len(held) < size and (chunk := schedule.take()) is not None:
            held.append(chunk)
        if not held:
            break
        chunk = held.pop(rng.integers(len(held)))
        count = int(rng.integers(0, chunk.stop - chunk.first + 1))
        run += [(chunk.condition, chunk.first + k) for k in range(count)]
        schedule.give_back(chunk, count)
        ended += schedule.finished_stages()
    assert sorted(run) == sorted(todo)
    assert (schedule.remaining, ended) == (0, borders)


def test_chunks_grow_small_towards_the_end():
    schedule = Schedule.of([[], []], [10**6], 8)
    sizes = []
    while (chunk := schedule.take()) is not None:
        sizes.append(chunk.stop - chunk.first)
    assert sizes[0] == MOST_ROWS
    assert sizes[-1] == 1
    assert sum(sizes) == 2 * 10**6
    assert len(sizes) < 400


def test_an_earlier_stage_comes_first_and_an_end_stops_the_rest():
    schedule = Schedule.of([[]], [4, 8], 1)
    first = [schedule.take() for _ in range(8)]
    assert [chunk.first for chunk in first if chunk] == list(range(8))
    for chunk in first[:4]:
        schedule.give_back(chunk, 1)
    assert list(schedule.finished_stages()) == [4]
    schedule.end_at(4)
    schedule.give_back(first[5], 0)  # what comes late is no harm
    assert (schedule.take(), schedule.remaining, schedule.final) == (None, 0, 4)


def run_all(state):
    """Run what the state hands out until there is no more."""
    while (chunk := state.next_chunk()) is not None:
        state.take_in(result_of(chunk))


def test_a_study_runs_until_all_is_there():
    state = make_state()
    run_all(state)
    assert (state.phase, state.computed, state.schedule.final) == (Phase.FINISHED, 4, 4)
    assert list(state.store.rows(0, 0, 4)["steps"]) == [0, 1, 2, 3]


def test_a_study_may_end_at_an_earlier_stage():
    seen = []
    state = make_state((2, 4, 8), lambda stop: seen.append(stop) or stop == 4)
    run_all(state)
    assert (state.phase, state.schedule.final, seen) == (Phase.FINISHED, 4, [2, 4])


def test_with_nothing_missing_it_ends_at_the_first_look():
    state = StudyState(Schedule.of([[(0, 4)]], [4], 1), None, None, None)
    state.look_at_stages()
    assert state.phase is Phase.FINISHED


def test_an_interrupted_study_hands_out_nothing_but_takes_in_what_is_finished():
    state = make_state()
    first = state.next_chunk()
    state.interrupt()
    assert state.next_chunk() is None
    state.take_in(result_of(first))
    assert (state.phase, state.computed, state.schedule.final) == (Phase.INTERRUPTED, 1, -1)


def test_what_was_interrupted_may_have_been_the_last():
    state = make_state((1,))
    last = state.next_chunk()
    state.interrupt()
    state.take_in(result_of(last))
    assert (state.phase, state.schedule.final) == (Phase.FINISHED, 1)
    state.interrupt()
    assert state.phase is Phase.FINISHED


def test_what_is_given_up_takes_in_nothing():
    state = make_state()
    chunk = state.next_chunk()
    state.give_up()
    state.take_in(result_of(chunk))
    state.interrupt()
    assert (state.phase, state.computed, state.next_chunk()) == (Phase.GIVEN_UP, 0, None)


def test_what_is_not_done_is_handed_out_again():
    state = make_state((40,))
    chunk = state.next_chunk()
    assert chunk.stop - chunk.first == 13
    state.take_in(result_of(chunk, 5))
    assert state.next_chunk().first == 5


def test_too_many_failures_end_the_study_after_what_came_was_written():
    state = make_state(allowed=1)
    state.take_in(result_of(state.next_chunk(), failed=1))
    with pytest.raises(TooManyFailures, match=r"2 replicates failed, .* stalled"):
        state.take_in(result_of(state.next_chunk(), failed=1))
    assert (state.computed, len(state.store.notes)) == (2, 2)
