"""One cycle in its two execution modes: flags, phases and records."""

from typing import Final

# Flags that `next` and `run` return. `flags` keeps all but CYCLE_STOPPED and CYCLE_NONE.
CYCLE_OK: Final[int]  # every required sync unit answered in this cycle
CYCLE_LATE: Final[int]  # cycles were skipped before this one, or Python missed cycles
CYCLE_LIMITED: Final[int]  # a set-point or an output column was limited
CYCLE_WORKING_COUNTER: Final[int]  # lost_limit cycles in a row were not ok
CYCLE_DROPPED: Final[int]  # the core stopped an axis, or a drive refused a mode
CYCLE_REFUSED: Final[int]  # a target or a column was refused (NaN, infinite, beyond the step limit)
CYCLE_UNCOMMITTED: Final[int]  # threaded: no new targets were committed for this cycle
CYCLE_LAW_DONE: Final[int]  # the law returned "finished"
CYCLE_LAW_FAILED: Final[int]  # the law failed: the drives are stopped
CYCLE_CLOCKS: Final[int]  # the clocks were locked or unlocked since `Clock.changes` was read
CYCLE_DRY: Final[int]  # the stream of set-points is empty: an underrun
CYCLE_STOPPED: Final[int]  # the native thread has ended (stop, or an error of the link)
CYCLE_NONE: Final[int]  # no new cycle within timeout_ns: the actual values are unchanged

EXECUTION_MODES: Final[dict[str, int]]
PHASE_NAMES: Final[dict[str, int]]  # phases in the order of a report
RECORD_FIELDS: Final[list[tuple[str, str]]]
"""The fields of one record of `log()`, for `numpy.dtype(RECORD_FIELDS)`; no padding.

number u8 · scheduled_ns, wake_ns i8 (the link's clock) · period_ns, lateness_ns, receive_ns,
process_ns, send_ns, post_processing_ns, round_trip_ns, output_delay_ns, input_age_ns i4 · flags,
lost_in_row, skipped u4 · missing_frames, al_counter u2 · al_status u1 ..."""
