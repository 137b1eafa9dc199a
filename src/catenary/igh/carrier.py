"""KernelCarrier: what a loop asks of an activated master."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import TYPE_CHECKING

from catenary.bus.event import LinkLost, LinkRestored
from catenary.errors import CatenaryError, IdentityError, StateError
from catenary.igh import abi
from catenary.igh.configure import Configuration
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.survey import Answer
from catenary.wire.al import State, status_code
from catenary.wire.register import AL_STATUS_CODE

if TYPE_CHECKING:
    from catenary.igh.main_device import MainDevice

OP_TIMEOUT = 20.0  # [s]: the master configures one device after the other
LOOK = 0.005  # [s] between two looks
EMERGENCY_SIZE = 8
LINKS = 2  # the main one and the backup


class KernelCarrier:
    """Owns an activated configuration. Fulfils `bus.Carrier`."""

    def __init__(self, main: MainDevice, configuration: Configuration) -> None:
        self.configuration = configuration
        self._main = main
        self._library = main.reservation.library
        self._links: list[bool | None] = [None] * LINKS

    @property
    def image(self) -> object:
        return self.configuration.exchange.capsule

    def end(self) -> None:
        """No call is made any more."""
        self.configuration.exchange.end()

    def state(self, position: int) -> abi.ConfigState:
        """What the master says of its configuration of a device."""
        state = abi.ConfigState()
        config = self.configuration.devices[position].config
        self._library.ask(
            "ecrt_slave_config_state", config, ctypes.byref(state), what=f"device {position}"
        )
        return state

    def bring_to_op(self, positions: Sequence[int]) -> Procedure[None]:
        """The master leads them; cycles must flow meanwhile."""
        waiting = list(positions)
        for _ in range(round(OP_TIMEOUT / LOOK)):
            waiting = [p for p in waiting if not self.state(p).operational]
            if not waiting:
                return
            refusing = [p for p in waiting if self._main.reservation.slave(p).error_flag]
            if refusing:
                waiting = refusing
                break
            yield after(LOOK)
        raise (yield from self._not_in_op(waiting))

    def survey(self) -> Procedure[list[Answer]]:
        """Who answers, and from which state; the reason of those that are not in OP."""
        answers = []
        for sub in self._main.subs:
            state = self.state(sub.position)
            if not state.online:
                answers.append(Answer(sub.station, None))
                continue
            word, code = int(state.al_state), 0
            if word != State.OP:
                code = yield from self._status_code(sub.position)
            answers.append(Answer(sub.station, word, code))
        return answers

    def listen(self) -> Procedure[None]:
        """Emergencies of all devices, links of both interfaces."""
        target = ctypes.create_string_buffer(EMERGENCY_SIZE)
        for device in self.configuration.devices:
            while (
                self._library.ecrt_slave_config_emerg_pop(device.config, ctypes.addressof(target))
                == 0
            ):
                self._main.hear(device.position, target.raw)
        self._look_at_links()
        yield after(0)

    def _look_at_links(self) -> None:
        handle = self._main.reservation.handle
        for number in range(LINKS):
            state = abi.MasterState()
            found = self._library.ecrt_master_link_state(handle, number, ctypes.byref(state))
            if found < 0:  # there is no such interface
                return
            before, self._links[number] = self._links[number], bool(state.link_up)
            if before is None or before == bool(state.link_up):
                continue
            now, which = self._main.link.now() * 1e-9, ("main", "backup")[number]
            end = 0 if number == 0 else len(self._main.subs) - 1
            kind = LinkRestored if state.link_up else LinkLost
            what = "carries again" if state.link_up else "does not carry any more"
            message = f"the cable of the {which} interface {what}"
            self._main.events.put(kind(now, None, message, (None, end)))

    def _status_code(self, position: int) -> Procedure[int]:
        sub = self._main.subs[position]
        try:
            data = yield from sub.read_register(  # type: ignore[attr-defined]
                AL_STATUS_CODE.address, AL_STATUS_CODE.size
            )
        except CatenaryError:
            return 0  # it is told as unknown
        return AL_STATUS_CODE.unpack(data)

    def _not_in_op(self, waiting: Sequence[int]) -> Procedure[CatenaryError]:
        """Why the first of them is not there."""
        sub = self._main.subs[waiting[0]]
        info = self._main.reservation.slave(sub.position)
        expected, found = sub.identity[:2], (info.vendor_id, info.product_code)
        if expected != found:
            return IdentityError(
                f"{sub.station}: another device is there now: vendor 0x{found[0]:08X} product "
                f"0x{found[1]:08X}",
                position=sub.position,
                expected=expected,
                found=found,
                hint="put the right one back, or scan again",
            )
        code = yield from self._status_code(sub.position)
        reason = f" (AL status code 0x{code:04X}: {status_code(code).text})" if code else ""
        others = f"; with it {len(waiting) - 1} others" if len(waiting) > 1 else ""
        state = info.al_state & 0xF
        named = str(State(state)) if state in tuple(State) else f"state {state}"
        return StateError(
            f"{sub.station} did not reach OP: it is in {named}{reason}{others}",
            position=sub.position,
            requested=int(State.OP),
            actual=state,
            code=code,
            hint=status_code(code).cause
            or f"ethercat config -v -p {sub.position} shows what was configured, dmesg what failed",
        )
