"""Interface to a master, which brings the devices of a MainDevice up and down."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

from catenary.bus.event_queue import Events
from catenary.bus.external_master import Carrier
from catenary.bus.runner import BlockingRunner
from catenary.bus.sdo import Objects
from catenary.bus.sub_device import DeviceOwner, SubDevice
from catenary.link import Link
from catenary.model.device import DeviceDescription
from catenary.wire.al import AlState

if TYPE_CHECKING:  # plan imports NumPy, which a scan does not need
    from catenary.bus.diagnosis import Diagnosis
    from catenary.bus.states import Outcome
    from catenary.plan.planner import Plan
    from catenary.plan.request import ProcessDataRequest


Complete: TypeAlias = Callable[[DeviceDescription], DeviceDescription]


class MasterOwner(DeviceOwner, Protocol):
    """Interface of a MainDevice to its master. `MainDevice` documents the properties."""

    @property
    def link(self) -> Link: ...

    @property
    def runner(self) -> BlockingRunner: ...

    @property
    def has_loop(self) -> bool: ...

    @property
    def events(self) -> Events: ...


class Master(Protocol):
    """Interface to `bus.FrameMaster`, which sends its own frames, or to `igh.KernelMaster`.

    `MainDevice` documents the calls. A call that a master does not support raises
    ConfigurationError.
    """

    @property
    def carrier(self) -> Carrier | None:
        """External master that exchanges the images; None if the loop sends its own frames."""

    def scan(self, complete: Complete) -> tuple[Sequence[SubDevice], tuple[str, ...]]:
        """Bring all devices to PRE-OP. Return their handles, and notes about the segment.

        Args:
            complete: Function that adds the facts of ESI files to a description.
        """

    def passive_scan(self, *, names: bool) -> Sequence[DeviceDescription]: ...

    def request_states(
        self, devices: Sequence[DeviceDescription], positions: Sequence[int], state: AlState
    ) -> dict[int, Outcome]: ...

    def diagnose(
        self, subs: Sequence[SubDevice], *, since: Diagnosis | None, lost_frames: int
    ) -> Diagnosis: ...

    def read_mappings(self, requests: Sequence[ProcessDataRequest], period_ns: int) -> None: ...

    def read_objects(
        self, wanted: Mapping[int, Sequence[tuple[int, int]]]
    ) -> dict[int, Objects]: ...

    def configure(self, plan: Plan, epoch_ns: int) -> tuple[int | None, ...]:
        """Bring all devices to SAFE-OP.

        Args:
            plan: Plan to write.
            epoch_ns: System time of the clocks minus link time [ns].

        Returns:
            By position, the delay after the first clock [ns]; empty if delays were not measured.
        """

    def leave(self, timeout: float) -> None:
        """End operation: bring all devices to PRE-OP within `timeout` [s] for each state."""

    def close(self, timeout: float) -> None:
        """Bring all devices down as far as the master can, before the link closes."""

    def forget(self) -> None:
        """Release the parent's resources in a forked child."""


@runtime_checkable
class MasterSource(Protocol):
    """Link source that makes its own master."""

    def make_master(self, main: MasterOwner) -> Master: ...
