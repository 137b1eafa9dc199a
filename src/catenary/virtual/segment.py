"""Virtual segment: devices in a tree or ring, with a clock, faults and links."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from typing import Literal, NamedTuple, Protocol, runtime_checkable

from catenary.virtual._segment import Core
from catenary.virtual._segment_link import SegmentLink
from catenary.virtual._wires import Wires
from catenary.virtual.cloned_line import cloned_line
from catenary.virtual.device_names import DeviceNames
from catenary.virtual.devices.coupler import Coupler
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.digital_outputs import DigitalOutputs
from catenary.virtual.devices.servo import Servo
from catenary.virtual.devices.twin import TwinOptions
from catenary.virtual.fault_player import FaultEvent, FaultPlayer, Loss
from catenary.virtual.faults import Fault
from catenary.virtual.plant import Plant, PlantPart
from catenary.virtual.service import Service
from catenary.virtual.wiring import Place, Wiring

SECOND = 1e9
LONGEST_PUSH = 10.0  # [s]
ClockKind = Literal["virtual", "monotonic"]
# Time from the loss of light until the loop is closed [s], with enhanced link detection of the
# ET1100 (about 15 us: datasheet, section I, chapter 6) and with an ordinary PHY.
LINK_LOSS_DETECTION: Mapping[str, float] = {"enhanced": 15e-6, "standard": 3e-3}


@runtime_checkable
class SharedClock(Protocol):
    """Virtual clock that a segment shares with other participants."""

    @property
    def capsule(self) -> object:
        """Capsule with the C table of native/clock.h."""


class FrameCounters(NamedTuple):
    """Numbers of frames and datagrams since the creation of the segment."""

    frames: int
    datagrams: int
    malformed: int
    foreign: int  # not EtherCAT
    lost: int
    expired: int  # lost because they waited for longer than `max_age`


class SegmentEnd:
    """End of a segment, to which a MainDevice connects."""

    def __init__(self, segment: Segment, *, second: bool) -> None:
        self._segment = segment
        self._second = second

    @property
    def segment(self) -> Segment:
        """Segment to which this end belongs."""
        return self._segment

    def open_link(self) -> SegmentLink:
        """Open a link at this end of the segment. Only one link per end can be open."""
        return self._segment.open_end(second=self._second)


class Segment:
    """Virtual devices and their cables. `segment[i]` is the device at position i, `segment["j2"]`
    that with this name.

    Args:
        devices: Devices, in the order in which they process frames.
        clock: "virtual": a discrete-event clock, which advances only while the link waits.
            "monotonic": the machine's clock, for real time in this process and for `serve`.
            A `realtime.VirtualClock`, or a participant of it (`clock.participate()`): virtual time
            that is shared with tasks. The loop on this segment then runs as this participant, and
            in its thread.
        plant: Simulated mechanism that the motors of the servos drive, or a part of it
            (`Plant.part`) if the motors of other segments drive it too.
        faults: Faults to inject. Their times are on the segment's clock (`time`).
        behind: Mapping from a device to the (device, port) that it is connected to. The default is
            port 1 of the previous device.
        ring: True if a cable connects the last device to a second interface of the MainDevice.
            Until a link is opened at that end, the segment is a line.
        link_loss_detection: Time until controllers detect a dark cable: "enhanced" (15 us),
            "standard" (3 ms) or a number of seconds.

    Raises:
        ValueError: An option is out of range or does not fit the devices.
        ConfigurationError: The plant does not fit the devices.
    """

    def __init__(
        self,
        devices: Sequence[Device],
        *,
        clock: ClockKind | SharedClock = "virtual",
        plant: Plant | PlantPart | None = None,
        faults: Sequence[Fault] = (),
        behind: Mapping[int, Place] | None = None,
        ring: bool = False,
        link_loss_detection: float | Literal["enhanced", "standard"] = "enhanced",
    ) -> None:
        self._devices = list(devices)
        self.clock = _clock_kind(clock)
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
        part = plant.part() if isinstance(plant, Plant) else plant
        self.plant = None if part is None else part.plant
        self._service = Service(self._core, self._devices, part)
        self._faults = FaultPlayer(
            self._core, self._wires, self._devices, wiring, self._service.agenda, part
        )
        self._service.at_first_frame(self._faults.start)
        self._links: dict[bool, SegmentLink] = {}
        self._names = DeviceNames(self._core, self._devices)
        for fault in faults:
            self.inject(fault)

    @classmethod
    def from_clone(
        cls,
        folder: str | PathLike[str],
        *,
        clock: ClockKind | SharedClock = "virtual",
        plant: Plant | PlantPart | None = None,
        faults: Sequence[Fault] = (),
        options: Mapping[str, TwinOptions] | None = None,
    ) -> Segment:
        """Return a segment with twins of the devices of a clone (docs/how_to/test_your_machine.md).

        Args:
            folder: Folder that `catenary clone` has written.
            clock: See `Segment`.
            plant: See `Segment`.
            faults: See `Segment`.
            options: Motors and quirks of devices, by name; None: the standard ones.

        Raises:
            CloneError: A file of the folder is missing or not valid.
            ConfigurationError: The SII of a device was not read, the devices cannot be connected,
                or the plant does not fit them.
            ValueError: An option is out of range.
        """
        devices, behind = cloned_line(folder, options)
        return cls(devices, clock=clock, plant=plant, faults=faults, behind=behind)

    def __len__(self) -> int:
        return len(self._devices)

    def __getitem__(self, key: int | str) -> Device:
        """Return the device at a position, or with a name.

        Raises:
            IndexError: There is no such position.
            KeyError: No device has the name, or several have it.
        """
        return self._devices[key if isinstance(key, int) else self._names.find(key)]

    def name_devices(self, stations: Mapping[str, int]) -> None:
        """Give devices the names of a machine file, for `segment["j2"]`.

        Args:
            stations: Station address of each device, by its name, as the last scan set it.
        """
        self._names.give(stations)

    def __iter__(self) -> Iterator[Device]:
        return iter(self._devices)

    @property
    def core(self) -> Core:
        """Compiled segment, for `serve` and for tests at register level."""
        return self._core

    @property
    def wires(self) -> Wires:
        """Compiled cables, for tests of routes."""
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
        """End at the first device."""
        return SegmentEnd(self, second=False)

    @property
    def second(self) -> SegmentEnd:
        """Second end of a ring, for `MainDevice(segment.first, segment.second)`."""
        if not self.ring:
            raise ValueError("only a ring has a second end; use Segment(..., ring=True)")
        return SegmentEnd(self, second=True)

    def open_link(self) -> SegmentLink:
        """Open a link at the first end of the segment. Only one link per end can be open."""
        return self.open_end(second=False)

    def open_end(self, *, second: bool) -> SegmentLink:
        """Open a link at the first end, or with `second` at the second end of a ring.

        In real time, the first link starts the service thread. Closing the last link ends it.

        Raises:
            ValueError: The end already has a link or does not exist.
        """
        if second in self._links:
            raise ValueError("the segment already has an open link at this end; close it first")
        name = "virtual, second end" if second else "virtual"
        link = SegmentLink(self._core, name, lambda: self._link_closed(second), second=second)
        if self.clock == "monotonic" and not self._links:
            self._service.start()
        self._links[second] = link
        self._service.agenda.deferred = self.clock == "monotonic"
        if second:
            self._wires.raise_end(1, True)
        return link

    def _link_closed(self, second: bool) -> None:
        del self._links[second]
        if second:
            self._wires.raise_end(1, False)
        if self.clock == "monotonic" and not self._links:
            self._service.stop()
            self._service.agenda.deferred = False

    # -- faults --------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time on the segment's clock, which faults use [s].

        Virtual time starts when the segment is created, real time with its first frame.
        """
        return self._faults.now

    def inject(self, fault: Fault) -> None:
        """Schedule a fault for the time `fault.at`.

        Without a time, or if the time has passed, the fault begins immediately.

        Raises:
            ValueError: The fault does not fit this segment. The message names the field.
        """
        self._faults.add(fault)

    def push(
        self,
        body: str,
        force: Sequence[float],
        *,
        point: Sequence[float] = (0.0, 0.0, 0.0),
        for_: float = 0.2,
    ) -> None:
        """Push a body of the plant. Another push of the same body replaces it.

        Args:
            body: name of the body in the model.
            force: (3,) in the frame of the world [N].
            point: (3,) point of the body on which the force acts, in its frame [m].
            for_: duration [s].

        Raises:
            ValueError: There is no plant or no such body, or a value is out of range.
        """
        if self.plant is None:
            raise ValueError("the segment has no plant; use Segment(..., plant=Plant(...))")
        _check_push(force, point, for_)
        self.plant.body_number(body)
        plant, agenda = self.plant, self._service.agenda

        def begin() -> None:
            agenda.after(round(for_ * SECOND), plant.push(body, force, point))

        if self._core.is_virtual:
            begin()
        else:  # in the thread that may change devices
            agenda.after(0, begin)

    @property
    def faults_done(self) -> bool:
        """True if no begin or end of a fault is pending. Active faults without end are ignored."""
        return self._faults.done

    @property
    def fault_log(self) -> tuple[FaultEvent, ...]:
        """Log of the faults injected so far."""
        return tuple(self._faults.log)

    def take_losses(self) -> list[Loss]:
        """Return the frames lost since the last call, up to the last 4096."""
        return self._faults.take_losses()

    def unplug(self) -> None:
        """Unplug the uplink cables of all devices.

        Unlike with a fault, the controllers detect this immediately. The cable between the last
        device of a ring and the MainDevice stays plugged in.
        """
        self._plug_first(0)

    def plug(self, devices: int | None = None) -> None:
        """Plug in the uplinks of the first `devices` devices (None: all), and unplug the others."""
        self._plug_first(len(self._devices) if devices is None else devices)

    def plug_port(self, device: int, port: int, plugged: bool) -> None:
        """Plug or unplug the cable at a port. Any thread may call it.

        Args:
            device: Position of the device.
            port: Number of the port.
            plugged: True to plug the cable in.

        Raises:
            ValueError: No cable belongs to the port.
        """
        number = self._faults.wiring.cable_at(device, port)
        self._wires.plug_cable(number, plugged)

    def switch_power(self, device: int, on: bool) -> None:
        """Switch a device on or off. Any thread may call it.

        In real time, while a link is open, the thread of the service does it.

        Args:
            device: Position of the device.
            on: True to switch it on.

        Raises:
            ValueError: There is no such device.
        """
        if not 0 <= device < len(self._devices):
            raise ValueError(f"there is no device {device}; it has {len(self._devices)} devices")
        chosen = self._devices[device]
        if on:
            chosen.power_on()
        else:
            chosen.power_off()

    def _plug_first(self, devices: int) -> None:
        for number in range(len(self._devices)):
            self._wires.plug_cable(number, number < devices, at_once=True)


def _clock_kind(clock: object) -> ClockKind:
    if clock not in ("virtual", "monotonic") and not isinstance(clock, SharedClock):
        raise ValueError(f'clock must be "virtual", "monotonic" or a VirtualClock, not {clock!r}')
    return "monotonic" if clock == "monotonic" else "virtual"


def _detection_ns(given: float | str) -> int:
    seconds = LINK_LOSS_DETECTION.get(given, None) if isinstance(given, str) else given
    if seconds is None or not 0 <= seconds <= 1:
        raise ValueError(
            f'link_loss_detection must be "enhanced", "standard" or 0 to 1 s, not {given!r}'
        )
    return round(seconds * 1e9)


def _check_push(force: Sequence[float], point: Sequence[float], duration: float) -> None:
    for name, values in (("force", force), ("point", point)):
        if len(values) != 3 or not all(math.isfinite(value) for value in values):
            raise ValueError(f"{name} must be three finite numbers, not {list(values)}")
    if not 0 < duration <= LONGEST_PUSH:
        raise ValueError(f"for_ must be above 0 and at most {LONGEST_PUSH:g} s, not {duration}")


def demo_segment(*, clock: ClockKind = "virtual", ring: bool = False) -> Segment:
    """Create a segment with a coupler, a digital output, three servo drives and a digital output.

    Args:
        clock: See `Segment`.
        ring: See `Segment`.
    """
    devices: list[Device] = [Coupler(), DigitalOutputs()]
    devices += [Servo(name=f"Catenary virtual servo {k}", serial=k) for k in (1, 2, 3)]
    return Segment([*devices, DigitalOutputs()], clock=clock, ring=ring)
