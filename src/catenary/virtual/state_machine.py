"""EtherCAT state machine of a device with a microcontroller, ETG.1000.6 §6.4.

A request is checked immediately and answered after a typical transition time. In an error state,
only a request for INIT is accepted without an acknowledgement. This is the behaviour of Beckhoff's
slave stack code (SSC 5.11 to 5.13, ecatslv.c, AL_ControlInd) and of SOES (soes/esc.c, ESC_state).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from catenary.virtual.scheduler import Scheduler

INIT, PRE_OP, BOOT, SAFE_OP, OP = 1, 2, 3, 4, 8
ACKNOWLEDGE = ERROR = 0x10
IDENTIFICATION = 0x20

INVALID_STATE_CHANGE = 0x0011
UNKNOWN_STATE = 0x0012
BOOTSTRAP_NOT_SUPPORTED = 0x0013
INVALID_MAILBOX_CONFIGURATION = 0x0016
NO_VALID_OUTPUTS = 0x0019
SYNCHRONISATION_ERROR = 0x001A
SYNC_MANAGER_WATCHDOG = 0x001B
INVALID_OUTPUT_CONFIGURATION = 0x001D
INVALID_INPUT_CONFIGURATION = 0x001E
INVALID_WATCHDOG_CONFIGURATION = 0x001F
NO_VALID_FIRMWARE = 0x0014
INVALID_BOOT_MAILBOX_CONFIGURATION = 0x0015
MODULES_DIFFER = 0x0070  # configured and detected idents
INVALID_INPUT_MAPPING = 0x0024
INVALID_OUTPUT_MAPPING = 0x0025
FATAL_SYNC_ERROR = 0x002C
NO_SYNC_ERROR = 0x002D
INVALID_DC_CONFIGURATION = 0x0030
DC_CYCLE_TIME = 0x0035
DC_SYNC0_CYCLE_TIME = 0x0036

UPWARDS = {(INIT, PRE_OP), (PRE_OP, SAFE_OP), (SAFE_OP, OP)}
WITH_BOOT = {(INIT, BOOT), (BOOT, BOOT), (BOOT, INIT)}  # all transitions from and to BOOT
MILLISECOND = 1_000_000
# Time limits of SAFE-OP → OP, by the AL status code of the missing condition. With SOEM and IgH,
# SYNC pulses start 100 ms after activation; other masters need longer.
TIMEOUTS_NS = {NO_VALID_OUTPUTS: 200 * MILLISECOND, NO_SYNC_ERROR: 1000 * MILLISECOND}


class Controlled(Protocol):
    """Controller and application of a device, as used by its state machine."""

    def fetch_al_control(self) -> int: ...

    def show_al_status(self, status: int, code: int) -> None: ...

    def check_state(self, state: int) -> int:
        """Return 0, or the AL status code of the reason why `state` cannot be entered."""
        ...

    def enter_state(self, before: int, state: int) -> None: ...

    def lacks_for_op(self) -> int:
        """Return 0, or the AL status code of a missing condition for OP."""
        ...


class StateMachine:
    """AL state of one device, and the state faults injected into it."""

    def __init__(
        self,
        device: Controlled,
        scheduler: Scheduler,
        identification: int,
        *,
        supports_boot: bool = False,
    ) -> None:
        self._device = device
        self._supports_boot = supports_boot
        self._scheduler = scheduler
        self._identification = identification
        self._request = 0  # number of the last request, which cancels earlier ones
        self._pending: int | None = None  # requested state without an answer
        self._waiting: tuple[bool, int] | None = None  # delayed OP: identification flag, request
        self.state = INIT
        self.code = 0
        self.transition_ns = MILLISECOND
        self.refused: dict[int, tuple[int, int | None]] = {}  # state → AL status code, count
        self.delays: dict[int, int | None] = {}  # state → delay [ns]; None: never reached

    def follow_request(self) -> None:
        """Handle a write to AL control."""
        control = self._device.fetch_al_control()
        requested, acknowledged = control & 0x0F, bool(control & ACKNOWLEDGE)
        if self.code and not acknowledged and requested != INIT:
            return
        self._request += 1
        self._pending = requested
        self.code = 0
        delay = self.delays.get(requested, self.transition_ns)
        if delay is None:
            return
        refusal = self._check_request(requested)
        if refusal:
            self._later(delay, lambda: self._refuse_with(refusal))
            return
        identify = bool(control & IDENTIFICATION)
        self._later(delay, lambda: self._enter(requested, identify))

    def _later(self, delay_ns: int, action: Callable[[], None]) -> None:
        request = self._request
        self._scheduler.after(delay_ns, lambda: action() if request == self._request else None)

    def _check_request(self, requested: int) -> int:
        if requested in self.refused:
            return self._refuse(requested)
        if requested == BOOT and not self._supports_boot:
            return BOOTSTRAP_NOT_SUPPORTED
        if requested not in (INIT, PRE_OP, BOOT, SAFE_OP, OP):
            return UNKNOWN_STATE
        if not _is_allowed(self.state, requested):
            return INVALID_STATE_CHANGE
        return self._device.check_state(requested)

    def _refuse(self, requested: int) -> int:
        code, times = self.refused.pop(requested)
        if times is None or times > 1:
            self.refused[requested] = code, None if times is None else times - 1
        return code

    def _refuse_with(self, code: int) -> None:
        self._pending = None
        self.fail(self.state, code)

    def _enter(self, state: int, identify: bool) -> None:
        lack = self._device.lacks_for_op() if (self.state, state) == (SAFE_OP, OP) else 0
        if lack:
            # Wait for process data or pulses, until `report_arrival` or the time limit.
            self._waiting = identify, self._request
            self._later(TIMEOUTS_NS[lack], lambda: self.fail(SAFE_OP, lack))
            return
        before, self.state, self.code, self._pending = self.state, state, 0, None
        self._device.enter_state(before, state)
        shown = IDENTIFICATION if identify and self._identification else 0
        self._device.show_al_status(state | shown, self._identification if shown else 0)

    def report_arrival(self) -> None:
        """Check a waiting request for OP again, after the first process data or SYNC pulse."""
        waiting, self._waiting = self._waiting, None
        if waiting is not None and waiting[1] == self._request:
            self._request += 1
            self._enter(OP, waiting[0])

    def fail(self, state: int, code: int) -> None:
        """Enter a lower state, or stay in `state`, and indicate an error.

        A pending request for `state` or a lower state is still answered. Real stacks change to a
        lower state immediately (SSC, ecatslv.c, AL_ControlInd, OP_2_INIT), so a local error cannot
        intervene. If the answer to INIT were lost, IgH would wait 5 s (master/fsm_change.c,
        ec_fsm_change_state_status).

        Args:
            state: The AL state to show.
            code: The AL status code to show.
        """
        if self._pending is None or self._pending > state:
            self._request += 1
            self._pending = None
        before, self.state, self.code = self.state, state, code
        if before != state:
            self._device.enter_state(before, state)
        self._device.show_al_status(state | ERROR, code)


def _is_allowed(state: int, requested: int) -> bool:
    """Return True if the standard has a transition from `state` to `requested`."""
    change = state, requested
    if BOOT in change:
        return change in WITH_BOOT
    return requested <= state or change in UPWARDS
