"""The image table over libethercat, and a link that provides only a clock."""

from collections.abc import Sequence
from typing import Literal, Protocol

from catenary.igh.library import Library

class Unit(Protocol):
    """A domain and its copies: (offset in the domain, offset in the image, size) [bytes]."""

    @property
    def domain(self) -> int: ...
    @property
    def data(self) -> int: ...
    @property
    def size(self) -> int: ...
    @property
    def outputs(self) -> Sequence[tuple[int, int, int]]: ...
    @property
    def inputs(self) -> Sequence[tuple[int, int, int]]: ...
    @property
    def divider(self) -> int: ...
    @property
    def phase(self) -> int: ...
    @property
    def optional(self) -> bool: ...

class KernelTime:
    """Clock of a loop on the kernel master. As a link, it carries no frames.

    The clock is CLOCK_MONOTONIC, with an offset while it follows the reference clock. With
    `virtual_time`, time advances only in `wait_until`.
    """

    def __init__(self, virtual_time: bool = False) -> None: ...
    is_virtual: bool
    @property
    def capsule(self) -> object: ...
    def send(self, frame: bytes) -> None: ...
    def receive(self) -> bytes | None: ...
    def now(self) -> int: ...
    def wait_until(self, deadline_ns: int, wake_on_frame: bool) -> bool: ...

class Exchange:
    """Process images of one activated configuration.

    Raises:
        ValueError: A copy exceeds its domain or its image.
    """

    def __init__(
        self,
        time: KernelTime,
        library: Library,
        master: int,
        units: Sequence[Unit],
        output_size: int,
        input_size: int,
    ) -> None: ...
    def keep_clocks(
        self,
        follow: Literal["reference", "main"] | None,
        period_ns: int,
        epoch_ns: int,
        bandwidth: float,
        rate_limit_ns: float,
        bound_ns: int,
    ) -> None:
        """Select the clock to follow and the limits of the control loop, before the first cycle.

        Args:
            follow: "reference" or "main"; None without distributed clocks.
            period_ns: The period of the loop.
            epoch_ns: Offset from the loop's clock to the application time.
            bandwidth: Bandwidth of the control loop, per cycle.
            rate_limit_ns: Largest correction per cycle.
            bound_ns: Largest error and difference that count as locked.
        """

    def clock_figures(self) -> dict[str, float]:
        """Return the figures of `core.Clock.figures` that libethercat provides.

        `spread` and `worst_spread` are bitwise ORs of the differences of all devices [ns]. The OR
        is at least the largest difference, and less than twice that.
        """

    def keep_within(self, bound_ns: int) -> None: ...
    def reset_clock_figures(self) -> None: ...
    @property
    def clock_changes(self) -> int:
        """Number of changes between locked and not locked."""

    @property
    def capsule(self) -> object: ...
    @property
    def figures(self) -> dict[str, int | float | bool]: ...
    def step(self) -> None: ...
    def steps(self, count: int) -> None: ...
    def end(self) -> None:
        """Stop all calls into libethercat. The handles of the master become invalid after this."""
