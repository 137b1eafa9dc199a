"""Playback of faults: each fault starts and ends at its time, and is logged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple, TypeAlias

from catenary.errors import ConfigurationError
from catenary.virtual import faults as f
from catenary.virtual._segment import Core
from catenary.virtual._wires import FRAME_FAULTS_MAX, Wires
from catenary.virtual.devices.applied import AppliedDevice
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.model_sensor import ModelSensor
from catenary.virtual.devices.motor_device import MotorDevice
from catenary.virtual.plant import PlantPart
from catenary.virtual.scheduler import Agenda
from catenary.virtual.wiring import Wiring

SECOND = 1_000_000_000
# In the order of `frame_fault_kind` (frame_faults.h).
FRAME_KINDS = ("lose_out", "lose_back", "corrupt", "garble", "delay", "duplicate")
LOSS_CAUSES = {
    1: "no light",  # the frame entered a dark cable before the controllers detected the loss
    2: "closed port",
    3: "circulating",
    4: "in flight",  # a cable went dark while the frame was on it
    5: "injected",
    6: "corrupt",
    7: "expired",  # the frame waited in the socket of a served segment for more than `max_age`
}

End: TypeAlias = Callable[[], None]


class FaultEvent(NamedTuple):
    """Entry of the fault log."""

    time: float  # time on the segment's clock [s]
    fault: f.Fault
    what: Literal["begins", "ends", "misses"]  # "misses": it could not begin


class Loss(NamedTuple):
    """A lost frame."""

    time: float  # time of sending [s]
    cause: str  # one of LOSS_CAUSES
    link: int  # 0 or 1


class FaultPlayer:
    """Planned and active faults of a segment, and their log."""

    def __init__(
        self,
        core: Core,
        wires: Wires,
        devices: list[Device],
        wiring: Wiring,
        agenda: Agenda,
        part: PlantPart | None = None,
    ) -> None:
        self._core = core
        self._wires = wires
        self._devices = devices
        self.wiring = wiring
        self._agenda = agenda
        self._part = part
        self._waiting: list[f.Fault] = []  # faults that wait for the first frame, in real time
        self._planned = 0
        self._frame_faults: list[tuple[int, f.FrameFault]] = []
        self._losses_seen = 0
        self.log: list[FaultEvent] = []

    @property
    def now(self) -> float:
        """Time of the segment [s]. In real time, it is 0 until the first frame."""
        return (self._core.now - self._core.epoch) / SECOND if self._core.epoch >= 0 else 0.0

    @property
    def done(self) -> bool:
        """True if no begin or end of a fault is pending."""
        left = any(self._wires.frame_fault_left(n) > 0 for n, _fault in self._frame_faults)
        return not (self._waiting or self._planned or left)

    def add(self, fault: f.Fault) -> None:
        """Schedule a fault for its time, or begin it immediately if it has none.

        Raises:
            ValueError: The fault does not fit this segment. The message names the field.
        """
        self._check(fault)
        if fault.at is None:
            self._now(fault)
        elif self._core.epoch < 0:
            self._waiting.append(fault)
        else:
            self._plan(fault, fault.at)

    def _now(self, fault: f.Fault) -> None:
        if self._core.is_virtual:
            self._begin(fault)
        else:  # only the service thread may change devices
            self._planned += 1
            self._agenda.after(0, partial(self._due, fault))

    def _plan(self, fault: f.Fault, at: float) -> None:
        self._planned += 1
        self._agenda.at(self._core.epoch + round(at * SECOND), partial(self._due, fault))

    def start(self) -> None:
        """Schedule the waiting faults. Called once, when the time of the segment starts."""
        waiting, self._waiting = self._waiting, []
        for fault in waiting:
            self._plan(fault, fault.at or 0.0)

    def _due(self, fault: f.Fault) -> None:
        self._planned -= 1
        self._begin(fault)

    def _begin(self, fault: f.Fault) -> None:
        try:
            self._check_kind(fault)
            self._check_room(fault)
        except ValueError:  # the device was replaced, or too many frame faults are active
            self.log.append(FaultEvent(self.now, fault, "misses"))
            return
        self.log.append(FaultEvent(self.now, fault, "begins"))
        end = self._inject(fault)
        lasts = getattr(fault, "for_", None)
        if isinstance(fault, (f.Swap, f.Exchange)):
            lasts = lasts or 0.0
        if end is None or lasts is None:
            return
        self._planned += 1
        self._agenda.after(round(lasts * SECOND), partial(self._end, fault, end))

    def _end(self, fault: f.Fault, end: End) -> None:
        self._planned -= 1
        self.log.append(FaultEvent(self.now, fault, "ends"))
        end()

    def take_losses(self) -> list[Loss]:
        """Return the frames lost since the last call, up to the last 4096."""
        found, self._losses_seen = self._wires.losses(self._losses_seen)
        epoch = max(self._core.epoch, 0)
        return [Loss((sent - epoch) / SECOND, LOSS_CAUSES[why], end) for sent, why, end in found]

    # -- checks --------------------------------------------------------------------------------

    def _check(self, fault: f.Fault) -> None:
        try:
            for name in ("device", "other"):
                self._check_place(name, getattr(fault, name, None))
            self._check_kind(fault)
        except ValueError as error:
            raise ValueError(f"fault {fault.kind}: {error}") from None

    def _check_place(self, name: str, position: int | None) -> None:
        if position is not None and position >= len(self._devices):
            last = len(self._devices) - 1
            raise ValueError(f"{name}: device {position} does not exist; the last one is {last}")

    def _check_kind(self, fault: f.Fault) -> None:
        match fault:
            case f.Cut() | f.Join() | f.Corrupt():
                self.wiring.between(*fault.between)
            case f.MailboxSilent() | f.LateMailbox() | f.RefuseState() | f.LeaveState():
                self._applied(fault.device)
            case f.DriveFault() | f.SafeTorqueOff():
                if fault.axis not in range(self._servo(fault.device).axes):
                    raise ValueError(f"axis: device {fault.device} has no axis {fault.axis}")
            case f.Swap():
                self._check_ports("with", fault.with_, fault.device)
                self._check_sensor(fault.with_)
            case f.Exchange():
                if fault.device == fault.other:
                    raise ValueError("other: a device cannot change places with itself")
                self._check_ports("other", self._devices[fault.other], fault.device)
                self._check_ports("device", self._devices[fault.device], fault.other)
            case _:
                pass

    def _check_room(self, fault: f.Fault) -> None:
        if isinstance(fault, f.FrameFault):
            self._remove_used_faults()
            if len(self._frame_faults) >= FRAME_FAULTS_MAX:
                raise ValueError(f"at most {FRAME_FAULTS_MAX} frame faults can be active at once")

    def _check_ports(self, name: str, device: Device, position: int) -> None:
        for port in range(4):
            if self.wiring.at_port(position, port) and port not in device.ports:
                raise ValueError(
                    f"{name}: {device.name} has no port {port}, but a cable is connected there"
                )

    def _check_sensor(self, device: Device) -> None:
        """Check that the plant has the sensors of a device, and set their sizes."""
        if not isinstance(device, ModelSensor):
            return
        if self._part is None:
            raise ValueError(f"with: {device.name} needs a plant, but the segment has none")
        try:
            self._part.prepare(device)
        except ConfigurationError as error:
            raise ValueError(f"with: {error.message}") from error

    def _applied(self, position: int) -> AppliedDevice:
        device = self._devices[position]
        if not isinstance(device, AppliedDevice):
            raise ValueError(f"device: device {position} ({device.kind}) has no application")
        return device

    def _servo(self, position: int) -> MotorDevice:
        device = self._devices[position]
        if not isinstance(device, MotorDevice) or not device.axes:
            raise ValueError(f"device: device {position} ({device.kind}) is not a servo")
        return device

    # -- injection -----------------------------------------------------------------------------

    def _inject(self, fault: f.Fault) -> End | None:
        """Begin the fault, and return the function that ends it, if any."""
        core, wires = self._core, self._wires
        match fault:
            case f.LoseFrames() | f.Corrupt() | f.Garble() | f.Delay() | f.Duplicate():
                return self._add_frame_fault(fault)
            case f.Cut():
                cable = self.wiring.between(*fault.between)
                wires.plug_cable(cable, False)
                return partial(wires.plug_cable, cable, True)
            case f.Join():
                wires.plug_cable(self.wiring.between(*fault.between), True)
            case f.Unplug():
                wires.plug_cable(fault.device, False)
                return partial(wires.plug_cable, fault.device, True)
            case f.Replug():
                wires.plug_cable(fault.device, True)
            case f.PowerCycle():
                return self._switch_off([fault.device])
            case f.Swap():
                self._switch_off([fault.device])
                return partial(self._replace_device, fault.device, fault.with_)
            case f.Exchange():
                self._exchange(fault.device, fault.other)
                return self._switch_off([fault.device, fault.other])
            case f.WrongWorkingCounter():
                core.mute(fault.device, True)
                return partial(core.mute, fault.device, False)
            case f.Drift():
                return self._drift(fault)
            case _:
                return self._inject_device(fault)
        return None

    def _inject_device(self, fault: f.Fault) -> End | None:
        match fault:
            case f.Freeze():
                device = self._devices[fault.device]
                device.freeze(True)
                return self._while_placed(device, lambda: device.freeze(False))
            case f.DriveFault():
                servo = self._servo(fault.device)
                servo.inject_fault(fault.code, fault.axis)
                return self._while_placed(servo, lambda: servo.inject_fault(0, fault.axis))
            case f.SafeTorqueOff():
                servo = self._servo(fault.device)
                servo.switch_sto(True, fault.axis)
                return self._while_placed(servo, lambda: servo.switch_sto(False, fault.axis))
            case f.MailboxSilent() | f.LateMailbox() | f.RefuseState() | f.LeaveState():
                return self._inject_application(fault)
        return None

    def _inject_application(
        self, fault: f.MailboxSilent | f.LateMailbox | f.RefuseState | f.LeaveState
    ) -> End | None:
        device = self._applied(fault.device)
        application = device.application
        if not self._core.powered(fault.device):
            return None  # a device without power has lost its application
        match fault:
            case f.MailboxSilent():
                application.mailbox.silence(True)
                return self._while_running(device, lambda: application.mailbox.silence(False))
            case f.LateMailbox():
                device.delay_mailbox(fault.by)
                return self._while_running(device, lambda: device.delay_mailbox(-fault.by))
            case f.RefuseState():
                state = f.number_of_state(fault.state)
                device.refuse_state(state, fault.code, fault.times)
                return self._while_running(device, lambda: device.refuse_state(state, None))
            case f.LeaveState():
                application.states.fail(f.number_of_state(fault.state), fault.code)
        return None

    def _while_placed(self, device: Device, undo: End) -> End:
        return lambda: undo() if device in self._devices else None

    def _while_running(self, device: AppliedDevice, undo: End) -> End:
        """Return a function that calls `undo`, unless a power loss has already ended the fault."""
        application = device.application
        return lambda: undo() if device.application is application else None

    def _add_frame_fault(self, fault: f.FrameFault) -> End:
        kind = f"lose_{fault.way}" if isinstance(fault, f.LoseFrames) else fault.kind
        number = self._wires.add_frame_fault(
            FRAME_KINDS.index(kind),
            frames=-1 if fault.frames is None else fault.frames,
            every=fault.every,
            delay_ns=round(fault.by * SECOND) if isinstance(fault, f.Delay) else 0,
            cable=self.wiring.between(*fault.between) if isinstance(fault, f.Corrupt) else -1,
            offset=-1 if not isinstance(fault, f.Garble) or fault.offset is None else fault.offset,
        )
        self._frame_faults.append((number, fault))
        return partial(self._remove_frame_fault, fault)

    def _remove_used_faults(self) -> None:
        used_up = [n for n, _ in self._frame_faults if self._wires.frame_fault_left(n) == 0]
        self._frame_faults = [held for held in self._frame_faults if held[0] not in used_up]
        for number in used_up:
            self._wires.remove_frame_fault(number)

    def _remove_frame_fault(self, fault: f.FrameFault) -> None:
        for held in self._frame_faults:
            if held[1] is fault:
                self._wires.remove_frame_fault(held[0])
                self._frame_faults.remove(held)
                return

    def _switch_off(self, positions: Sequence[int]) -> End:
        for position in positions:
            self._devices[position].switch_off()

        def switch_on() -> None:
            for position in positions:
                self._devices[position].switch_on()

        return switch_on

    def _drift(self, fault: f.Drift) -> End:
        device = self._devices[fault.device]
        before = device.crystal
        device.crystal = replace(before, ppm=fault.ppm)
        return lambda: setattr(device, "crystal", before)

    def _replace_device(self, position: int, device: Device) -> None:
        old = self._devices[position]
        old.detach()
        self._core.remove_controller(position)
        self._devices[position] = device
        device.attach(self._core, position, self._agenda)
        if self._part is not None:
            self._part.replaced(old, device)

    def _exchange(self, one: int, other: int) -> None:
        devices = self._devices
        for position in (one, other):
            devices[position].switch_off()
        self._core.exchange_controllers(one, other)
        devices[one], devices[other] = devices[other], devices[one]
        devices[one].position, devices[other].position = one, other
