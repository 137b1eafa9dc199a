"""A virtual segment: devices in a tree or a ring, a clock, faults, and links into it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, NamedTuple, Protocol, runtime_checkable

from catenary.virtual._segment import Core
from catenary.virtual._segment_link import SegmentLink
from catenary.virtual._wires import Wires
from catenary.virtual.devices.coupler import Coupler
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.digital_outputs import DigitalOutputs
from catenary.virtual.devices.servo import Servo
from catenary.virtual.fault_player import FaultEvent, FaultPlayer, Loss
from catenary.virtual.faults import Fault
from catenary.virtual.plant import Plant
from catenary.virtual.service import Service, ServiceThread
from catenary.virtual.wiring import Place, Wiring

ClockKind = Literal["virtual", "monotonic"]
# From the loss of light to the closed loop [s]: enhanced link detection of the ET1100 (datasheet,
# section I, chapter 6: about 15 us), and what an ordinary PHY takes.
LINK_LOSS_DETECTION: Mapping[str, float] = {"enhanced": 15e-6, "standard": 3e-3}


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
    expired: int  # of the lost ones: served too late (`max_age`)


class SegmentEnd:
    """One end of a segment, to be opened by whoever drives it."""

    def __init__(self, segment: Segment, *, second: bool) -> None:
        self._segment = segment
        self._second = second

    @property
    def segment(self) -> Segment:
        """The segment that has this end."""
        return self._segment

    def open_link(self) -> SegmentLink:
        """A link into the segment at this end; one at a time."""
        return self._segment.open_end(second=self._second)


class Segment:
    """Owns virtual devices and their cables. `segment[i]` is the device at position i.

    clock="virtual": a discrete-event clock; time advances only while the link waits.
    clock="monotonic": the machine's, for real time in this process and for `serve`.
    A `realtime.VirtualClock`, or a place on one (`clock.participate()`): virtual time shared with
    tasks; the loop on this segment takes that place, in the thread that the place is for.

    `plant`: what the motors of its servos turn. `faults`: what happens to it, by its own time
    (`time`). `behind`: device → (device, port) it
    hangs on, where that is not port 1 of the one before. `ring`: the last device leads back to a
    second interface of the MainDevice; until somebody opens that end, it is a line.
    `link_loss_detection`: how long controllers take to see that a cable is dark: "enhanced"
    (15 us), "standard" (3 ms) or seconds.
    """

    def __init__(
        self,
        devices: Sequence[Device],
        *,
        clock: ClockKind | SharedClock = "virtual",
        plant: Plant | None = None,
        faults: Sequence[Fault] = (),
        behind: Mapping[int, Place] | None = None,
        ring: bool = False,
        link_loss_detection: float | Literal["enhanced", "standard"] = "enhanced",
    ) -> None:
        if clock not in ("virtual", "monotonic") and not isinstance(clock, SharedClock):
            raise ValueError(f'clock is "virtual", "monotonic" or a VirtualClock, not {clock!r}')
        self._devices = list(devices)
        self.clock: ClockKind = "monotonic" if clock == "monotonic" else "virtual"
        wiring = Wiring([device.ports for device in devices], behind or {}, ring=ring)
        self._core = Core(
            len(self._devices),
            self.clock == "virtual",
            ring=ring,
            detection_ns=_detection_ns(link_loss_detection),
        )
        self._wires = Wires(self._core)
        for number, cable in enumerate(wiring.cables):
            self._wires.lay_cable(number, cable.up, cable.down)
        if isinstance(clock, SharedClock):
            self._core.use_clock(clock)
        self.plant = plant
        self._service = Service(self._core, self._devices, plant)
        self._faults = FaultPlayer(
            self._core,
            self._wires,
            self._devices,
            wiring,
            self._service.agenda,
            None if plant is None else plant.replaced,
        )
        self._service.at_first_frame(self._faults.start)
        self._thread: ServiceThread | None = None
        self._links: dict[bool, SegmentLink] = {}
        for fault in faults:
            self.inject(fault)

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
    def wires(self) -> Wires:
        """The compiled side's cables, for tests of where frames go."""
        return self._wires

    @property
    def service(self) -> Service:
        return self._service

    @property
    def ring(self) -> bool:
        return self._faults.wiring.ring

    @property
    def now_ns(self) -> int:
        return self._core.now

    @property
    def frames(self) -> FrameCounters:
        return FrameCounters(*self._core.counters)

    # -- links ---------------------------------------------------------------------------------

    @property
    def first(self) -> SegmentEnd:
        """The end towards the first device."""
        return SegmentEnd(self, second=False)

    @property
    def second(self) -> SegmentEnd:
        """A ring's other end: `MainDevice(segment.first, segment.second)`."""
        if not self.ring:
            raise ValueError("only a ring has a second end: Segment(..., ring=True)")
        return SegmentEnd(self, second=True)

    def open_link(self) -> SegmentLink:
        """A link into the segment, at its first end; one at a time."""
        return self.open_end(second=False)

    def open_end(self, *, second: bool) -> SegmentLink:
        """What `first` and `second` open."""
        if second in self._links:
            raise ValueError("the segment has an open link: close it first")
        name = "virtual, second end" if second else "virtual"
        link = SegmentLink(self._core, name, lambda: self._link_closed(second), second=second)
        if self.clock == "monotonic" and not self._links:
            self._thread = ServiceThread(self._service)
            self._thread.start()
        self._links[second] = link
        if second:
            self._wires.raise_end(1, True)
        return link

    def _link_closed(self, second: bool) -> None:
        del self._links[second]
        if second:
            self._wires.raise_end(1, False)
        if self._thread is not None and not self._links:
            self._thread.stop()
            self._thread = None

    # -- faults --------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """The time faults go by [s]: virtual time since the segment was made; in real time since
        its first frame."""
        return self._faults.now

    def inject(self, fault: Fault) -> None:
        """Plans a fault for `fault.at` on the segment's time; without one, or with one that has
        passed, it begins at once. ValueError names the field that does not fit the segment."""
        self._faults.add(fault)

    @property
    def faults_done(self) -> bool:
        """No fault is still to begin or to end; those without an end do not count."""
        return self._faults.done

    @property
    def fault_log(self) -> tuple[FaultEvent, ...]:
        """What was injected when."""
        return tuple(self._faults.log)

    def take_losses(self) -> list[Loss]:
        """The frames that did not come back since the last call, as far as the log goes (4096)."""
        return self._faults.take_losses()

    def unplug(self) -> None:
        """Pulls the cable between MainDevice and first device: no frame comes back. Seen by the
        controllers at once, other than a fault."""
        self._plug_first(0)

    def plug(self, devices: int | None = None) -> None:
        """Plugs all cables in; `devices`: the line is cut behind that many."""
        self._plug_first(len(self._devices) if devices is None else devices)

    def _plug_first(self, devices: int) -> None:
        for number in range(len(self._devices)):
            self._wires.plug_cable(number, number < devices, at_once=True)


def _detection_ns(given: float | str) -> int:
    seconds = LINK_LOSS_DETECTION.get(given, None) if isinstance(given, str) else given
    if seconds is None or not 0 <= seconds <= 1:
        raise ValueError(
            f'link_loss_detection is "enhanced", "standard" or 0 to 1 s, not {given!r}'
        )
    return round(seconds * 1e9)


def demo_segment(*, clock: ClockKind = "virtual", ring: bool = False) -> Segment:
    """A coupler, a digital output, three servo drives, a digital output."""
    devices: list[Device] = [Coupler(), DigitalOutputs()]
    devices += [Servo(name=f"Catenary virtual servo {k}", serial=k) for k in (1, 2, 3)]
    return Segment([*devices, DigitalOutputs()], clock=clock, ring=ring)
