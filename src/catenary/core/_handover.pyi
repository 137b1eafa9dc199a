"""Private and triple buffers between the cycle and Python; owned by Engine."""

from collections.abc import Sequence

class Handover:
    """Buffers between the cycle and Python."""

    def __init__(
        self, axes: int, units: int, input_counts: Sequence[int], output_counts: Sequence[int]
    ) -> None: ...
    def fields(self) -> dict[str, memoryview]: ...
