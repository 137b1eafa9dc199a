"""The image table over libethercat, and the link that is nothing but its clock."""

from collections.abc import Sequence
from typing import Literal, Protocol

from catenary.igh.library import Library

class Unit(Protocol):
    """A domain with what is copied: (offset in the domain, offset in the image, size)."""

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
    """Owns the clock of a loop on the kernel master: CLOCK_MONOTONIC, moved where it follows the
    reference clock; `virtual_time`: time passes only where it is waited for. Carries no frames."""

    def __init__(self, virtual_time: bool = False) -> None: ...
    is_virtual: bool
    @property
    def capsule(self) -> object: ...
    def send(self, frame: bytes) -> None: ...
    def receive(self) -> bytes | None: ...
    def now(self) -> int: ...
    def wait_until(self, deadline_ns: int, wake_on_frame: bool) -> bool: ...

class Exchange:
    """Owns the images of one activated configuration. ValueError for a copy that leaves its domain
    or image."""

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
        """Whom the clocks follow, and how close counts as together. Before the first cycle."""

    def clock_figures(self) -> dict[str, float]:
        """As `core.Clock.figures`, as far as libethercat tells; spread, worst_spread: what all
        devices together say of their difference [ns], at least the largest, below twice that."""

    def keep_within(self, bound_ns: int) -> None: ...
    def reset_clock_figures(self) -> None: ...
    @property
    def clock_changes(self) -> int:
        """How often the clocks came together or apart."""

    @property
    def capsule(self) -> object: ...
    @property
    def figures(self) -> dict[str, int | float | bool]: ...
    def step(self) -> None: ...
    def steps(self, count: int) -> None: ...
    def end(self) -> None:
        """The master's handles are about to go: no call is made any more."""
