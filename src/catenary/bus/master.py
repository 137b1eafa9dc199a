"""Master: what brings the devices of a MainDevice up and down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from catenary.bus.sdo import Objects
from catenary.bus.sub_device import SubDevice
from catenary.model.device import DeviceDescription
from catenary.wire.al import AlState

if TYPE_CHECKING:  # plan needs NumPy, a scan does not
    from catenary.bus.diagnosis import Diagnosis
    from catenary.bus.main_device import MainDevice
    from catenary.bus.states import Outcome
    from catenary.plan.planner import Plan
    from catenary.plan.request import Wish


class Master(Protocol):
    """Frames of our own (`bus.FrameMaster`), or the kernel master (`igh.KernelMaster`).

    `MainDevice` documents what the calls do. A master that cannot do one raises
    ConfigurationError.
    """

    def scan(self) -> tuple[Sequence[SubDevice], tuple[str, ...]]:
        """Return the handles of all devices, in PRE-OP, and notes."""

    def passive_scan(self, *, names: bool) -> Sequence[DeviceDescription]: ...

    def request_states(
        self, devices: Sequence[DeviceDescription], positions: Sequence[int], state: AlState
    ) -> dict[int, Outcome]: ...

    def diagnose(
        self, subs: Sequence[SubDevice], *, since: Diagnosis | None, lost_frames: int
    ) -> Diagnosis: ...

    def read_mappings(self, wishes: Sequence[Wish], period_ns: int) -> None: ...

    def read_objects(
        self, wanted: Mapping[int, Sequence[tuple[int, int]]]
    ) -> dict[int, Objects]: ...

    def configure(self, plan: Plan) -> None: ...

    def leave(self, timeout: float) -> None:
        """End operation: bring all devices to PRE-OP within `timeout` [s] for each state."""

    def close(self, timeout: float) -> None:
        """Prepare for the link to close: bring all devices down as far as the master can."""

    def forget(self) -> None:
        """Let go of what belongs to the parent, in a forked child."""


@runtime_checkable
class MasterSource(Protocol):
    """A link source that brings a master of its own."""

    def make_master(self, main: MainDevice) -> Master: ...
