"""64-bit words in shared memory with acquire/release ordering."""

class Words:
    """View of `count` words in a buffer: the first at byte `offset`, `stride` bytes apart.

    The constructor raises ValueError if they do not fit in the buffer.
    The methods raise IndexError if a word is out of range.
    """

    def __init__(self, memory: object, offset: int, count: int, stride: int = 8) -> None: ...
    def load(self, k: int) -> int:
        """Load word `k` (acquire), after a full fence that orders earlier reads.

        Data written before the store of this value is visible afterwards.
        """

    def load_all(self) -> list[int]:
        """Load all words."""

    def store(self, k: int, value: int) -> None:
        """Store word `k` (release), followed by a full fence that orders later writes.

        The store publishes all data written before it.
        """

    def add(self, k: int, value: int) -> int:
        """Add to word `k` in one atomic operation, modulo 2^64. Return its previous value."""
