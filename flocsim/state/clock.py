"""The time, the steps and the counters of a run."""

from flocsim.state.records import Record


class Tally(Record):
    """What a run's lists and sums have come to."""

    candidates: int  # pairs of features listed
    pairs: int  # pairs of bodies listed
    evaluations: int  # forces summed so far
    rebuilds: int  # lists made so far
    solves: int  # systems solved so far
    kept: int  # one more than displacements set aside for a list that found no room; 0: none are
    full: int  # what has found no room, see NOTHING_FULL
    series_terms: int  # terms of the last step's series in ``Work.series``; 0: it was none
    soft_gap: float  # smooth gap of the last two bodies that were asked for one [m]


# What Tally.full says.
(
    NOTHING_FULL,
    CANDIDATES_FULL,
    PAIRS_FULL,
    BLOCKS_FULL,
    NOT_COMPILED,  # what the engine has left out until it is reached
) = range(5)


class Clock(Record):
    """The times, steps and errors of a run."""

    time: float  # [s]
    until: float  # end of the run, or a stop on the way [s]
    horizon: float  # end of the run where ``until`` is a stop on the way; 0: it is not one [s]
    step: float  # next step [s]
    tolerance: float  # error that a step may have [m]; inf: steps are fixed
    error: float  # stated error of the motion so far [m]
    largest_step: float  # [s]
    bearable_step: float  # largest step that is expected to work at all [s]
    step_error: float  # error of the step just taken [m]
    estimate_share: float  # share of the method's own estimate that counts in the stated error
    # The last steps: what the next one is chosen by.
    previous_step: float  # size of the step before [s]; inf: there was none, 0: a trial has failed
    previous_ratio: float  # its error over the tolerance
    rejected_step: float  # size of the trial that was just rejected [s]; 0: none was
    rejected_ratio: float  # its error over the tolerance
    settling: float  # steps in a row that ended at a switch, until one has been taken that did not
    settled_step: float  # size of the last such step [s]
    flying_step: float  # step that was planned when the last flight ended [s]
    # Newton's method and the stages of Radau IIA.
    pace: float  # factor by which each iteration shrinks the last change
    seen_pace: float  # that of the last second iteration; 0: not known
    seen_step: float  # size of the step in which it was seen [s]
    staged_step: float  # size of the step whose stages are still there [s]; 0: none are
    staged_at: float  # time at which that step began [s]
    # Motion as a series.
    longest_series: float  # longest step whose motion may be a series; inf: any [s]
    series_step: float  # size of the step of the series in ``Work.series`` [s]
    series_turns: float  # that size times a bound of its fastest rate
    # Backward Euler, whose steps go on across switches.
    across: float  # 1 where steps go on across switches, 0 where they end there
    rates_known: float  # 1 where the rates of the last such step (LAST_RATES) are known
    switches: float  # switches since a method last looked how far it had come
    looked_at: float  # when that was [s]; inf: it is to look anew
    # Cycles of switches that are left out (events.cycles).
    cycle_at: float  # end of the last cycle [s]
    cycle_at_before: float  # end of the one before [s]
    cycle_error: float  # stated error at the end of the last [m]


class Counts(Record):
    """What a run has counted, and its budgets."""

    steps: int  # steps taken
    rejected: int  # steps tried in vain
    max_steps: int  # budget of both and of located events
    recorded: int  # rows in the record
    pause_at: int  # steps after which to pause
    code: int  # what the observer has said last
    located: int  # events located
    still: int  # steps in a row by which no time has passed
    look_at: int  # steps after which a method looks how far it has come
    looked_tried: int  # steps that had been tried when it last looked
    cycle_modes: int  # contact modes in which a cycle of switches begins; 0: none has begun
    cycle_code: int  # number that stands for what has switched since
    cycle_code_before: int  # the same of the cycle before
    cycle_switches: int  # switches since the cycle began
    cycles_seen: int  # cycles that have ended
    cycle_returns: int  # how often those modes have come again
