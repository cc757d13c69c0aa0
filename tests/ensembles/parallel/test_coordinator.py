"""Rank 0 and the others by the messages that they send, in one process and without waiting."""

import pytest

from flocsim.ensembles.kind import Chunk
from flocsim.ensembles.parallel.communicator import Communicator, Halt, Request, StopRequested
from flocsim.ensembles.parallel.coordinator import Coordinator, RemoteCoordinator
from flocsim.ensembles.parallel.schedule import TooManyFailures
from tests.helpers.study_state import make_state, result_of


class Wire(Communicator):
    """Notes what is sent; what arrives is put there by the test."""

    threads = False

    def __init__(self, rank, size):
        super().__init__()
        self.rank, self.size = rank, size
        self.sent, self.arriving = [], []

    def send(self, to, message):
        self.sent.append((to, message))

    def arrived(self):
        arriving, self.arriving = self.arriving, []
        return arriving

    def new(self):
        """What has been sent since the last look."""
        sent, self.sent = self.sent, []
        return sent


def coordinator(size=3, **more):
    """Rank 0's, of a study of four replicates."""
    found = Coordinator(Wire(0, size), make_state(**more), lambda remaining: None)
    found.start()
    return found


def asked(found, rank, result=None, interrupted=False):
    """What is sent after a request of a rank."""
    found.comm.arriving.append((rank, Request(result, interrupted)))
    found.serve()
    return found.comm.new()


def chunk(k):
    """The chunk of one replicate."""
    return Chunk(0, k, k + 1)


def test_every_request_gets_a_chunk_and_at_the_end_all_are_dismissed():
    rank0 = coordinator()
    assert asked(rank0, 1) == [(1, chunk(0))]
    assert asked(rank0, 2) == [(2, chunk(1))]
    assert rank0.exchange(None) == chunk(2)
    assert asked(rank0, 1, result_of(chunk(0))) == [(1, chunk(3))]
    assert asked(rank0, 2, result_of(chunk(1))) == []  # nothing to do now, but it may come back
    assert asked(rank0, 1, result_of(chunk(3), 0)) == [(2, chunk(3))]
    assert asked(rank0, 2, result_of(chunk(3))) == []
    assert rank0.exchange(result_of(chunk(2))) is None
    assert rank0.is_halted()
    assert rank0.comm.new() == [(1, None), (2, None)]
    rank0.finish()  # has nobody to wait for
    assert rank0.state.computed == 4


def test_a_signal_to_one_rank_halts_the_others_once():
    rank0 = coordinator(4)
    for rank in (1, 2, 3):
        asked(rank0, rank)
    assert asked(rank0, 1, result_of(chunk(0)), interrupted=True) == [
        (1, None), (2, Halt()), (3, Halt()),
    ]  # fmt: skip
    assert asked(rank0, 2, result_of(chunk(1))) == [(2, None)]
    assert asked(rank0, 3, result_of(chunk(2))) == [(3, None)]
    assert (rank0.present, rank0.state.computed) == (0, 3)


def test_when_it_is_enough_those_who_work_on_a_later_stage_are_halted():
    rank0 = coordinator(2, borders=(1, 4), is_enough=lambda stop: True)
    assert rank0.exchange(None) == chunk(0)
    assert asked(rank0, 1) == [(1, chunk(1))]
    assert rank0.exchange(result_of(chunk(0))) is None
    rank0.serve()
    assert rank0.comm.new() == [(1, Halt())]
    assert asked(rank0, 1, result_of(chunk(1), 0)) == [(1, None)]


def test_an_error_calls_all_back_and_takes_in_nothing_more():
    rank0 = coordinator(3, allowed=0)
    asked(rank0, 1)
    asked(rank0, 2)
    with pytest.raises(TooManyFailures):
        asked(rank0, 1, result_of(chunk(0), failed=1))
    rank0.comm.arriving.append((2, Request(result_of(chunk(1)), False)))
    assert rank0.give_up()
    assert rank0.comm.new() == [(1, None), (2, None)]
    assert rank0.state.computed == 1


def test_who_does_not_come_back_is_not_waited_for_long(monkeypatch):
    monkeypatch.setattr("flocsim.ensembles.parallel.coordinator.FAREWELL", 0.01)
    rank0 = coordinator(2)
    asked(rank0, 1)
    assert not rank0.give_up()
    assert rank0.comm.new() == [(1, Halt())]


def test_on_a_signal_rank_0_waits_no_longer_and_the_others_wait_for_it(stopping):
    with pytest.raises(StopRequested):
        Wire(0, 2).receive(1)
    other, looks = Wire(1, 2), iter([[], [], [(0, "a word")]])
    other.arrived = lambda: next(looks)
    assert other.receive(0) == "a word"


def test_another_rank_asks_and_works_until_it_is_halted():
    wire = Wire(1, 2)
    remote = RemoteCoordinator(wire)
    wire.arriving = [(0, chunk(0))]
    assert remote.exchange(None) == chunk(0)
    assert not remote.is_halted()
    wire.arriving = [(0, Halt())]
    assert remote.is_halted()
    wire.arriving = [(0, None)]
    assert remote.exchange(result_of(chunk(0), 0)) is None
    assert [type(message) for _, message in wire.sent] == [Request, Request]


def test_a_halt_that_crosses_a_request_is_no_answer():
    wire = Wire(1, 2)
    wire.arriving = [(0, Halt()), (0, None)]
    assert RemoteCoordinator(wire).exchange(result_of(chunk(0))) is None
