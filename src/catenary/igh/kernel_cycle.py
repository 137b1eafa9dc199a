"""KernelCarrier: the services of an activated master for a loop."""

from __future__ import annotations

import contextlib
import ctypes
import struct
from collections.abc import Sequence

from catenary.bus.event_types import LinkLost, LinkRestored, emergency
from catenary.errors import (
    CatenaryError,
    IdentityError,
    RegisterError,
    SegmentError,
    StateError,
)
from catenary.igh import abi
from catenary.igh.clock import KernelClock
from catenary.igh.configure import Configuration
from catenary.igh.kernel_access import KernelAccess
from catenary.igh.kernel_log import KernelLog
from catenary.igh.sub_device import SubDevice
from catenary.procedure.al_status_poll import Answer
from catenary.procedure.exchange import Procedure, after
from catenary.wire.al import AlState, status_code
from catenary.wire.coe import Emergency
from catenary.wire.register import AL_STATUS_CODE, SYSTEM_TIME_DIFFERENCE

OP_TIMEOUT = 20.0  # [s]: the master configures one device after the other
POLL_INTERVAL = 0.005  # [s] between two checks
CODE_TIMEOUT = 0.5  # [s] to read an AL status code
CODE_POLL_INTERVAL = 0.010  # [s]
INVALID_SYNC = 0x0030  # AL status code
SYNC_TYPE = 0x1C32, 1  # object and subindex
LINKS = 2  # main and backup interface
_EMERGENCY = struct.Struct("<HB5s")


class KernelCarrier:
    """Kernel master with an activated configuration. Implements `bus.Carrier`."""

    def __init__(self, kernel: KernelAccess, configuration: Configuration) -> None:
        self.configuration = configuration
        self._kernel = kernel
        self._library = kernel.reservation.library
        self._links: list[bool | None] = [None] * LINKS
        self._link_count = LINKS
        clock = configuration.clock
        self._clock = None if clock is None else KernelClock(configuration.exchange, clock)
        self._kernel_log = KernelLog()
        kernel.active = configuration

    @property
    def image(self) -> object:
        return self.configuration.exchange.capsule

    @property
    def clock(self) -> KernelClock | None:
        """Figures of the distributed clocks; None without clocks."""
        return self._clock

    def end(self) -> None:
        """Stop all calls into libethercat."""
        self._kernel.active = None
        self.configuration.exchange.end()
        self._kernel_log.close()

    def state(self, position: int) -> abi.ConfigState:
        """Return the state of the master's configuration of a device."""
        state = abi.ConfigState()
        config = self.configuration.devices[position].config
        self._library.ask(
            "ecrt_slave_config_state", config, ctypes.byref(state), what=f"device {position}"
        )
        return state

    def bring_to_op(self, positions: Sequence[int]) -> Procedure[None]:
        """Wait until the master has brought the devices to OP. Cycles must run during the wait.

        Raises:
            StateError: A device did not reach OP.
            IdentityError: Another device is at the position.
        """
        waiting = list(positions)
        for _ in range(round(OP_TIMEOUT / POLL_INTERVAL)):
            waiting = [p for p in waiting if not self.state(p).operational]
            if not waiting:
                return
            refusing = [p for p in waiting if self._refuses(p)]
            if refusing:
                waiting = refusing
                break
            yield after(POLL_INTERVAL)
        raise (yield from self._not_in_op(waiting))

    def _refuses(self, position: int) -> bool:
        """Return True if the master has stopped its attempts to configure the device."""
        if not self.state(position).online:
            return False
        return bool(self._kernel.reservation.slave(self._kernel.place_of(position)).error_flag)

    def survey(self) -> Procedure[list[Answer]]:
        """Return the state of each device, and the AL status code of each that is not in OP."""
        answers = []
        for sub in self._kernel.subs:
            state = self.state(sub.position)
            if not state.online:
                answers.append(Answer(sub.station, None))
                continue
            word, code = int(state.al_state), 0
            if word != AlState.OP:
                code = yield from self._status_code(sub.position)
            answers.append(Answer(sub.station, word, code))
        return answers

    def listen(self) -> Procedure[None]:
        """Read emergencies of all devices, the link states, and one device's clock difference."""
        target = ctypes.create_string_buffer(_EMERGENCY.size)
        for device in self.configuration.devices:
            while (
                self._library.ecrt_slave_config_emerg_pop(device.config, ctypes.addressof(target))
                == 0
            ):
                self._on_emergency(device.position, target.raw)
        self._poll_links()
        yield from self._read_difference()

    def _read_difference(self) -> Procedure[None]:
        """Read the clock difference of the next device."""
        yield after(0)
        position = None if self._clock is None else self._clock.next_device()
        if position is None or self._clock is None or not self.state(position).operational:
            return
        register = SYSTEM_TIME_DIFFERENCE
        with contextlib.suppress(RegisterError):  # no answer: the next turn reads it again
            self._clock.note(
                position, (yield from self._sub(position).read_register(register.address, 4))
            )

    def _sub(self, position: int) -> SubDevice:
        sub = self._kernel.subs[position]
        assert isinstance(sub, SubDevice)  # made by the scan of a kernel master
        return sub

    def _on_emergency(self, position: int, message: bytes) -> None:
        """Emit an event for an emergency (8 bytes) that the master has stored."""
        sub = self._kernel.subs[position]
        received = Emergency(*_EMERGENCY.unpack(message))
        if isinstance(sub, SubDevice):
            sub.add_emergency(received)
        now = self._kernel.main.link.now() * 1e-9
        self._kernel.main.events.put(emergency(now, sub, received))

    def _poll_links(self) -> None:
        handle = self._kernel.reservation.handle
        for number in range(self._link_count):
            state = abi.MasterState()
            found = self._library.ecrt_master_link_state(handle, number, ctypes.byref(state))
            if found < 0:  # no such interface: do not read it again, as libethercat prints an error
                self._link_count = number
                return
            before, self._links[number] = self._links[number], bool(state.link_up)
            if before is None or before == bool(state.link_up):
                continue
            now, which = self._kernel.main.link.now() * 1e-9, ("main", "backup")[number]
            end = 0 if number == 0 else len(self._kernel.subs) - 1
            kind = LinkRestored if state.link_up else LinkLost
            what = "has its link again" if state.link_up else "lost its link"
            message = f"the cable of the {which} interface {what}"
            self._kernel.main.events.put(kind(now, None, message, (None, end)))

    def _status_code(self, position: int) -> Procedure[int]:
        """Return the AL status code of a device in error; 0 if it is unknown.

        The code is in the kernel's log. If this process cannot read the log, read the register of
        the device. The master refuses requests until it has acknowledged the error, and the
        acknowledgement may clear the code.
        """
        try:
            place = self._kernel.place_of(position)
        except SegmentError:
            return 0  # the device was unplugged
        code = self._kernel_log.status_code(self._kernel.reservation.index, place)
        if code:
            return code
        sub = self._sub(position)
        deadline = self._deadline()
        while self._kernel.main.link.now() < deadline:
            try:
                data = yield from sub.read_register(AL_STATUS_CODE.address, AL_STATUS_CODE.size)
                return AL_STATUS_CODE.unpack(data)
            except CatenaryError:
                yield after(CODE_POLL_INTERVAL)
        return 0

    def _not_in_op(self, waiting: Sequence[int]) -> Procedure[CatenaryError]:
        """Return the error for the first device that is not in OP."""
        sub = self._sub(waiting[0])
        try:
            info = self._kernel.reservation.slave(self._kernel.place_of(sub.position))
        except CatenaryError as error:
            return StateError(
                f"{sub.station} did not reach OP: it is no longer on the segment ({error})",
                position=sub.position,
                requested=int(AlState.OP),
                actual=0,
                code=0,
                hint="check its cable and power; ethercat slaves lists the devices",
            )
        expected, found = sub.identity[:2], (info.vendor_id, info.product_code)
        if expected != found:
            return IdentityError(
                f"{sub.station}: another device is at its position: vendor 0x{found[0]:08X} "
                f"product 0x{found[1]:08X}",
                position=sub.position,
                expected=expected,
                found=found,
                hint="reconnect the original device, or scan again",
            )
        code = yield from self._status_code(sub.position)
        reason = f" (AL status code 0x{code:04X}: {status_code(code).text})" if code else ""
        others = f"; {len(waiting) - 1} other devices failed, too" if len(waiting) > 1 else ""
        state = info.al_state & 0xF
        named = str(AlState(state)) if state in tuple(AlState) else f"state {state}"
        return StateError(
            f"{sub.station} did not reach OP: it is in {named}{reason}{others}",
            position=sub.position,
            requested=int(AlState.OP),
            actual=state,
            code=code,
            hint=(yield from self._cause(sub, code)),
        )

    def _cause(self, sub: SubDevice, code: int) -> Procedure[str]:
        """Return the likely cause of an AL status code, and what to do next."""
        if code == INVALID_SYNC:
            return (yield from self._cause_of_invalid_sync(sub))
        if code and status_code(code).cause:
            return status_code(code).cause
        return (
            f"sudo dmesg | grep EtherCAT shows the AL status code, which neither libethercat nor "
            f"the device reports; ethercat config -v -p {sub.position} shows the configuration"
        )

    def _cause_of_invalid_sync(self, sub: SubDevice) -> Procedure[str]:
        """Return the cause of 0x0030: the SYNC unit and 0x1C32:01 contradict each other."""
        sync = self.configuration.devices[sub.position].sync
        kind = yield from self._sync_type(sub)
        value = "its 0x1C32:01 could not be read" if kind is None else f"its 0x1C32:01 is {kind}"
        if sync is not None:
            return (
                f"this loop starts SYNC0 every {sync.cycle_ns / 1e3:g} us with AssignActivate "
                f"0x{sync.assign_activate:04X}, and {value}: compare AssignActivate and cycle with "
                "Dc/OpMode in its ESI file"
            )
        return (
            f"{value}, and this loop does not start SYNC0. A program that was killed may have left "
            "2 or 3 there (SYNC0 or SYNC1). Switch the device off and on, or run ethercat download "
            f"-p {sub.position} -t uint16 0x1C32 1 0 (free run; 1: SyncManager events), and the "
            "same with 0x1C33; or use dc=True"
        )

    def _sync_type(self, sub: SubDevice) -> Procedure[int | None]:
        """Return 0x1C32:01 of a device in error; None if it does not answer in time."""
        if not sub.description.coe:
            return None
        asked, deadline = sub.sdo.request(*SYNC_TYPE), self._deadline()
        while not asked.done and self._kernel.main.link.now() < deadline:
            yield after(CODE_POLL_INTERVAL)
        if not asked.done:
            return None
        try:
            return int.from_bytes(asked.result(), "little")
        except CatenaryError:
            return None  # the object is absent or cannot be read: see the hint

    def _deadline(self) -> int:
        return self._kernel.main.link.now() + round(CODE_TIMEOUT * 1e9)
