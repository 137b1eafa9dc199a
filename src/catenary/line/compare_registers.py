"""Comparison of the registers of a device: state, controller, clocks and error counters.

Registers that a MainDevice writes are compared only if the device is in the same state in both
clones. In INIT they are left from an earlier start-up, and `VARIABLE`. System time, its offset,
delays and receive times are not compared.
"""

from __future__ import annotations

from collections.abc import Iterator

from catenary.line.change import ABSENT, Change, Part, Severity
from catenary.line.sides import Sides
from catenary.line.value_text import bytes_text, bytes_texts
from catenary.line.values import ClonedDevice
from catenary.wire import register
from catenary.wire.al import STATE_MASK, AlState, status_code
from catenary.wire.dl import DlStatus
from catenary.wire.error_counters import FULL, ErrorCounters, decode_error_counters
from catenary.wire.register_names import at_address
from catenary.wire.register_text import explain
from catenary.wire.sync_manager import Activation, PdiControl

FROM_EEPROM = {  # constant, or loaded from the EEPROM
    each.address
    for each in (
        *(register.INFORMATION, register.PDI_CONTROL, register.ESC_CONFIGURATION),
        *(register.PDI_CONFIGURATION, register.SYNC_LATCH_CONFIGURATION),
        register.PDI_EXTENDED_CONFIGURATION,
    )
}
NOT_COMPARED = {
    each.address
    for each in (
        *(register.DL_STATUS, register.ERROR_COUNTERS, register.RECEIVE_TIMES),
        *(register.SYSTEM_TIME_OFFSET, register.SYSTEM_TIME_DELAY),
    )
}
SYNC_MANAGERS = {register.sync_manager(k).address for k in range(register.SYNC_MANAGER_COUNT)}
RUNNING = (AlState.SAFE_OP, AlState.OP)
ERROR_FLAG = 0x10
_CLOCKS = register.RECEIVE_TIMES.address
_REPEAT = bytes(6) + bytes((Activation.REPEAT_REQUEST, PdiControl.REPEAT_ACKNOWLEDGE))
_PORT_FIELDS = (
    ("invalid_frames", "broken frames"),
    ("symbol_errors", "symbol errors"),
    ("forwarded", "forwarded broken frames"),
    ("lost_links", "lost links"),
)
_CONFIGURED = "the next start-up writes it again"


def compare_registers(sides: Sides) -> Iterator[Change]:
    """Yield the changes of state, registers and error counters.

    Args:
        sides: The device.
    """
    yield from _state(sides)
    yield from _eeprom_loaded(sides)
    same_state = _state_of(sides.old) == _state_of(sides.new)
    for address in sorted({*sides.old.registers, *sides.new.registers} - NOT_COMPARED):
        if address in FROM_EEPROM or same_state:
            yield from _register(sides, address)
    yield from _counters(sides)


def _state_of(device: ClonedDevice) -> int:
    return device.al_status & STATE_MASK


def _state(sides: Sides) -> Iterator[Change]:
    old, new = sides.old, sides.new
    failed = bool(new.al_status & ERROR_FLAG)
    before = (bool(old.al_status & ERROR_FLAG), old.al_status_code)
    if failed and before != (True, new.al_status_code):
        note = status_code(new.al_status_code).cause
        yield sides.change(Part.STATE, "", _states(sides), Severity.FAULT, note)
    elif _state_of(old) != _state_of(new):
        note = "registers that a MainDevice writes are not compared"
        yield sides.change(Part.STATE, "", _states(sides), Severity.INFO, note)


def _states(sides: Sides) -> tuple[str, str]:
    return _state_text(sides.old), _state_text(sides.new)


def _state_text(device: ClonedDevice) -> str:
    state = _state_of(device)
    name = str(AlState(state)) if state in tuple(AlState) else f"state {state}"
    if not device.al_status & ERROR_FLAG:
        return name
    code = device.al_status_code
    return f"{name} with error 0x{code:04X} ({status_code(code).text})"


def _eeprom_loaded(sides: Sides) -> Iterator[Change]:
    address = register.DL_STATUS.address
    if address not in sides.old.registers or address not in sides.new.registers:
        return
    old, new = (
        DlStatus.from_word(each.dl_status).pdi_operational for each in (sides.old, sides.new)
    )
    if old != new:
        texts = _loaded(old), _loaded(new)
        severity = Severity.INFO if new else Severity.FAULT
        yield sides.change(Part.STATE, "EEPROM", texts, severity)


def _loaded(operational: bool) -> str:
    return "loaded" if operational else "not loaded"


def _register(sides: Sides, address: int) -> Iterator[Change]:
    old, new = (_content(each, address) for each in (sides.old, sides.new))
    if old == new:
        return
    size = len(old if old is not None else new or b"")
    found = at_address(address, size)
    what = str(found) if found is not None else f"0x{address:04X}"
    part = Part.CLOCK if address >= _CLOCKS else Part.REGISTER
    severity = _severity(address, _state_of(sides.new))
    note = "" if severity is Severity.EFFECT else _CONFIGURED
    yield sides.change(part, what, _texts(address, old, new), severity, note)


def _severity(address: int, state: int) -> Severity:
    """Return the severity of a changed register. In INIT, it is left from an earlier start-up."""
    if address in FROM_EEPROM or state in RUNNING:
        return Severity.EFFECT
    return Severity.VARIABLE if state == AlState.INIT else Severity.INFO


def _content(device: ClonedDevice, address: int) -> bytes | None:
    """Return the content of a register without the bits that change in every mailbox exchange."""
    data = device.registers.get(address)
    if data is None or address not in SYNC_MANAGERS:
        return data
    return bytes(byte & ~bit for byte, bit in zip(data, _REPEAT, strict=False))


def _texts(address: int, old: bytes | None, new: bytes | None) -> tuple[str, str]:
    if old is None or new is None:
        return _text(address, old), _text(address, new)
    texts = _text(address, old), _text(address, new)
    return texts if texts[0] != texts[1] else bytes_texts(old, new)


def _text(address: int, data: bytes | None) -> str:
    if data is None:
        return ABSENT
    found = at_address(address, len(data))
    return (explain(found, data) if found is not None else None) or bytes_text(data)


def _counters(sides: Sides) -> Iterator[Change]:
    data = [each.registers.get(register.ERROR_COUNTERS.address) for each in (sides.old, sides.new)]
    if data[0] is None or data[1] is None or sides.exchanged:
        return
    old, new = decode_error_counters(data[0]), decode_error_counters(data[1])
    restarted = new.restarted(old)
    if restarted:
        texts = _total(old), _total(new)
        note = "the counters restarted: the device was switched off, or they were cleared"
        yield sides.change(Part.ERRORS, "", texts, Severity.INFO, note)
    for name, before, now in _pairs(old, new):
        if now > before:
            full = "; the counter is full" if now == FULL else ""
            more = f"{now} since then" if restarted else f"{now - before} more"
            texts = str(before), str(now)
            yield sides.change(Part.ERRORS, name, texts, Severity.FAULT, more + full)


def _pairs(old: ErrorCounters, new: ErrorCounters) -> Iterator[tuple[str, int, int]]:
    for number, (before, now) in enumerate(zip(old.ports, new.ports, strict=True)):
        for field, name in _PORT_FIELDS:
            yield f"port {number} {name}", getattr(before, field), getattr(now, field)
    yield "processing unit", old.processing_unit, new.processing_unit
    yield "PDI", old.pdi, new.pdi


def _total(counters: ErrorCounters) -> str:
    found = explain(register.ERROR_COUNTERS, counters.encode())
    return found or "no errors"
