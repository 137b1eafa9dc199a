"""Cycles that another process starts, through shared memory."""

TRIGGER_SIZE: int

class TriggerBlock:
    """Memory that the sender of a trigger and its receivers share.

    Args:
        memory: A writable buffer of at least `TRIGGER_SIZE` bytes, zeros at first. It begins at a
            multiple of 64 bytes.

    Raises:
        ValueError: The buffer is too small or not aligned.
    """

    def __init__(self, memory: object) -> None: ...
    @property
    def ticks(self) -> int:
        """Number of cycles of all senders, modulo 2^32."""

    @property
    def scheduled_ns(self) -> int:
        """Newest cycle start of the sender [ns, CLOCK_MONOTONIC]; 0: none yet."""

    @property
    def period_ns(self) -> int:
        """Period of the sender [ns]; 0: none yet."""
