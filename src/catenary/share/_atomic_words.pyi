"""64-bit words in shared memory with acquire/release ordering."""

class Words:
    """`count` words of a buffer from `offset` on, `stride` bytes apart.

    Raises ValueError if they do not fit in the buffer, IndexError for a word out of range.
    """

    def __init__(self, memory: object, offset: int, count: int, stride: int = 8) -> None: ...
    def load(self, k: int) -> int:
        """Load a word (acquire), after a full fence for earlier reads.

        Data that was written before the store of this value is visible afterwards.
        """

    def load_all(self) -> list[int]:
        """Load every word."""

    def store(self, k: int, value: int) -> None:
        """Store a word (release), and then a full fence for later writes.

        This publishes the data that was written before.
        """
