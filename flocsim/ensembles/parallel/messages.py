"""What the ranks say to each other while a study runs.

rank 0 → another rank         the flocs and the Facts of its study (or ExitCode, wherever it fails)
every other rank → rank 0     Request, again and again: a chunk's result, and a wish for another
rank 0 → another rank         how many replicates are to be run, and the key of the study's identity
                              for their records, once (or ExitCode, where the study cannot begin)
                              a Chunk in answer to a Request, None where there is no more
                              Halt, while it works, when its chunk is of no use any more
                              ExitCode, after the last answer, when all is written
every other rank → rank 0     Kept and Going, while it works, where replicates take long
"""

import attrs

from flocsim.ensembles.chunks import Chunk


@attrs.frozen
class ChunkResult:
    """What came of a chunk: its first ``count`` replicates, as a record of the journal.

    ``data_start``: bytes of the record before the rows; ``failed``: how many replicates have
    failed; ``notes``: what is known of them.
    """

    chunk: Chunk
    count: int
    record: bytes
    data_start: int
    failed: int = 0
    notes: tuple[dict, ...] = ()


@attrs.frozen
class Kept:
    """What is kept of an unfinished replicate of the condition at a place, as a record of the
    journal; whether progress counts it."""

    condition: int
    replicate: int
    record: bytes
    counts: bool


@attrs.frozen
class Going:
    """How far a rank's replicate is, in words."""

    words: str


@attrs.frozen
class Request:
    """A rank has finished its chunk (``result`` None: has had none yet) and asks for another.

    ``interrupted``: a signal has asked it to stop.
    """

    result: ChunkResult | None
    interrupted: bool


@attrs.frozen
class Halt:
    """Give up the replicate at hand, and hand in what is finished."""


@attrs.frozen
class ExitCode:
    code: int
