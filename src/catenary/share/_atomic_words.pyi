"""64-bit words in shared memory, stored and loaded in an order that holds on every processor."""

class Words:
    """`count` words of a buffer, `stride` bytes apart from `offset` on. ValueError: they cannot lie
    there; IndexError: there is no such word."""

    def __init__(self, memory: object, offset: int, count: int, stride: int = 8) -> None: ...
    def load(self, k: int) -> int:
        """The word. What was written before it was stored is there now; and what was read before is
        of the time before this."""

    def load_all(self) -> list[int]:
        """Every word."""

    def store(self, k: int, value: int) -> None:
        """Publishes what was written before. What is written from now on is seen by nobody who still
        loads the old value behind it."""
