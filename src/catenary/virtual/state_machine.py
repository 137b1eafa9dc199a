"""The EtherCAT state machine of a device with a microcontroller, ETG.1000.6 §6.4.

A request is judged, prepared, and answered after the time such a device takes. In an error state
only INIT is obeyed without an acknowledgement, as in Beckhoff's slave stack code (SSC 5.11 to 5.13,
ecatslv.c, AL_ControlInd) and in SOES (soes/esc.c, ESC_state).
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
FATAL_SYNC_ERROR = 0x002C
NO_SYNC_ERROR = 0x002D
INVALID_DC_CONFIGURATION = 0x0030
DC_CYCLE_TIME = 0x0035
DC_SYNC0_CYCLE_TIME = 0x0036

UPWARDS = {(INIT, PRE_OP), (PRE_OP, SAFE_OP), (SAFE_OP, OP)}
MILLISECOND = 1_000_000
# How long SAFE-OP → OP waits for what it lacks, by the AL status code that ends the wait. SYNC
# pulses start 100 ms after they are switched on with SOEM and IgH, and later with others.
TIMEOUTS_NS = {NO_VALID_OUTPUTS: 200 * MILLISECOND, NO_SYNC_ERROR: 1000 * MILLISECOND}


class Controlled(Protocol):
    """The controller and application a state machine rules."""

    def fetch_al_control(self) -> int: ...

    def show_al_status(self, status: int, code: int) -> None: ...

    def check_state(self, state: int) -> int:
        """0, or the AL status code why `state` cannot be entered."""
        ...

    def enter_state(self, before: int, state: int) -> None: ...

    def lacks_for_op(self) -> int:
        """0, or the AL status code of what OP cannot be entered without."""
        ...


class StateMachine:
    """Owns the AL state of one device, and the faults injected into it."""

    def __init__(self, device: Controlled, scheduler: Scheduler, identification: int) -> None:
        self._device = device
        self._scheduler = scheduler
        self._identification = identification
        self._request = 0  # counts requests: a later one overtakes an earlier
        self._pending: int | None = None  # the state of a request that is not answered yet
        self._waiting: tuple[bool, int] | None = None  # for OP: identify, request
        self.state = INIT
        self.code = 0
        self.transition_ns = MILLISECOND
        self.refused: dict[int, tuple[int, int | None]] = {}  # state → AL status code, times
        self.delays: dict[int, int | None] = {}  # state → [ns]; None: it is never reached

    def obey(self) -> None:
        """AL control was written."""
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
        refusal = self._judge(requested)
        if refusal:
            self._later(delay, lambda: self._refuse_with(refusal))
            return
        identify = bool(control & IDENTIFICATION)
        self._later(delay, lambda: self._enter(requested, identify))

    def _later(self, delay_ns: int, action: Callable[[], None]) -> None:
        request = self._request
        self._scheduler.after(delay_ns, lambda: action() if request == self._request else None)

    def _judge(self, requested: int) -> int:
        if requested in self.refused:
            return self._refuse(requested)
        if requested == BOOT:
            return BOOTSTRAP_NOT_SUPPORTED
        if requested not in (INIT, PRE_OP, SAFE_OP, OP):
            return UNKNOWN_STATE
        if requested > self.state and (self.state, requested) not in UPWARDS:
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
            # process data or pulses did not come yet: they take it up, or the time runs out
            self._waiting = identify, self._request
            self._later(TIMEOUTS_NS[lack], lambda: self.fail(SAFE_OP, lack))
            return
        before, self.state, self.code, self._pending = self.state, state, 0, None
        self._device.enter_state(before, state)
        shown = IDENTIFICATION if identify and self._identification else 0
        self._device.show_al_status(state | shown, self._identification if shown else 0)

    def something_arrived(self) -> None:
        """The first process data, or the first SYNC pulse."""
        waiting, self._waiting = self._waiting, None
        if waiting is not None and waiting[1] == self._request:
            self._request += 1
            self._enter(OP, waiting[0])

    def fail(self, state: int, code: int) -> None:
        """Fall to, or stay in, `state` and show the error.

        A pending request for `state` or a lower one is answered all the same. Real stacks go down
        at once (SSC, ecatslv.c, AL_ControlInd, OP_2_INIT), so no local error comes between. IgH
        waits 5 s for an INIT that got lost (master/fsm_change.c, ec_fsm_change_state_status).
        """
        if self._pending is None or self._pending > state:
            self._request += 1
            self._pending = None
        before, self.state, self.code = self.state, state, code
        if before != state:
            self._device.enter_state(before, state)
        self._device.show_al_status(state | ERROR, code)
