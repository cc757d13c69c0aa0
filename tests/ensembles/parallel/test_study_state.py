"""What rank 0 knows, without any message: phases, what is taken in, when it is enough."""

import pytest

from flocsim.ensembles.parallel.schedule import Schedule
from flocsim.ensembles.parallel.study_state import Phase, StudyState, TooManyFailures
from tests.helpers.study_state import make_state, result_of


def run_all(state):
    """Run what the state hands out until there is no more."""
    while (chunk := state.next_chunk()) is not None:
        state.take_in(result_of(chunk))


def test_a_study_runs_until_all_is_there():
    state = make_state()
    run_all(state)
    assert (state.phase, state.computed, state.schedule.final) == (Phase.FINISHED, 4, 4)
    assert list(state.store.read(0, "steps", 0, 4)) == [0, 1, 2, 3]


def test_a_study_may_end_at_an_earlier_stage():
    seen = []
    state = make_state((2, 4, 8), lambda stop: seen.append(stop) or stop == 4)
    run_all(state)
    assert (state.phase, state.schedule.final, seen) == (Phase.FINISHED, 4, [2, 4])


def test_with_nothing_missing_it_ends_at_the_first_look():
    state = StudyState(Schedule.of([[(0, 4)]], [4], 1), None, None, 0)
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
    assert (state.computed, len(state.notes)) == (2, 2)
