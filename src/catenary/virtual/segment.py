"""A virtual segment: devices on a line, a clock, and a link into it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal, NamedTuple, Protocol, runtime_checkable

from catenary.virtual._segment import Core, SegmentLink
from catenary.virtual.devices.coupler import Coupler
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.digital_outputs import DigitalOutputs
from catenary.virtual.devices.servo import Servo
from catenary.virtual.service import Service, ServiceThread

ClockKind = Literal["virtual", "monotonic"]


@runtime_checkable
class SharedClock(Protocol):
    """What a segment needs of a virtual clock that others live by too."""

    @property
    def capsule(self) -> object:
        """The C table of native/clock.h."""


class FrameCounters(NamedTuple):
    frames: int
    datagrams: int
    malformed: int
    foreign: int
    lost: int


class Segment:
    """Owns a line of virtual devices. `segment[i]` is the device at position i.

    clock="virtual": a discrete-event clock; time advances only while the link waits.
    clock="monotonic": the machine's, for real time in this process and for `serve`.
    A `realtime.VirtualClock`, or a place on one (`clock.participate()`): virtual time shared with
    tasks; the loop on this segment takes that place, in the thread that the place is for.
    """

    def __init__(
        self, devices: Sequence[Device], *, clock: ClockKind | SharedClock = "virtual"
    ) -> None:
        if clock not in ("virtual", "monotonic") and not isinstance(clock, SharedClock):
            raise ValueError(f'clock is "virtual", "monotonic" or a VirtualClock, not {clock!r}')
        self._devices = tuple(devices)
        self.clock: ClockKind = "monotonic" if clock == "monotonic" else "virtual"
        self._core = Core(len(self._devices), self.clock == "virtual")
        if isinstance(clock, SharedClock):
            self._core.use_clock(clock)
        self._service = Service(self._core, self._devices)
        self._thread: ServiceThread | None = None
        self._link: SegmentLink | None = None

    @classmethod
    def from_toml(cls, path: str | Path, *, clock: ClockKind = "virtual") -> Segment:
        """Reads the devices from a file; ConfigurationError names the file and the field."""
        from catenary.virtual.configuration import read_devices

        return cls(read_devices(path), clock=clock)

    def __len__(self) -> int:
        return len(self._devices)

    def __getitem__(self, position: int) -> Device:
        return self._devices[position]

    def __iter__(self) -> Iterator[Device]:
        return iter(self._devices)

    @property
    def core(self) -> Core:
        """The compiled side, for `serve` and tests at register level."""
        return self._core

    @property
    def service(self) -> Service:
        return self._service

    @property
    def now_ns(self) -> int:
        return self._core.now

    @property
    def frames(self) -> FrameCounters:
        return FrameCounters(*self._core.counters)

    def open_link(self) -> SegmentLink:
        """A link into the segment; one at a time."""
        if self._link is not None:
            raise ValueError("the segment has an open link: close it first")
        if self.clock == "monotonic":
            self._thread = ServiceThread(self._service)
            self._thread.start()
        self._link = SegmentLink(self._core, "virtual", self._link_closed)
        return self._link

    def _link_closed(self) -> None:
        self._link = None
        if self._thread is not None:
            self._thread.stop()
            self._thread = None

    def unplug(self) -> None:
        """Pulls the cable between MainDevice and first device: no frame comes back."""
        self._core.connect(False, len(self._devices))

    def plug(self, devices: int | None = None) -> None:
        """Plugs it in again; `devices`: the line is cut behind that many."""
        reachable = len(self._devices) if devices is None else devices
        self._core.connect(True, reachable)


def demo_segment(*, clock: ClockKind = "virtual") -> Segment:
    """A coupler, a digital output, three servo drives, a digital output."""
    devices: list[Device] = [Coupler(), DigitalOutputs()]
    devices += [Servo(name=f"Catenary virtual servo {k}", serial=k) for k in (1, 2, 3)]
    return Segment([*devices, DigitalOutputs()], clock=clock)
