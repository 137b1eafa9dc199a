"""Explanations of register contents, as text."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntFlag
from typing import TypeAlias

from catenary.errors import DecodeError
from catenary.wire import register
from catenary.wire.al import AlControl, AlStatus, status_code
from catenary.wire.clock import Activation as SyncActivation
from catenary.wire.clock import decode_clock, decode_difference
from catenary.wire.dl import PORTS, DlControl, DlStatus
from catenary.wire.error_counters import decode_error_counters
from catenary.wire.features import decode_information
from catenary.wire.fmmu import decode_fmmu
from catenary.wire.register_names import AnyRegister
from catenary.wire.sii_interface import (
    CONFIGURATION_FORCE,
    CONFIGURATION_TO_PDI,
    ControlStatus,
)
from catenary.wire.sync_manager import Activation, decode_sync_manager

Explain: TypeAlias = Callable[[bytes], str]


def explain(of: AnyRegister, data: bytes) -> str | None:
    """Return an explanation of the content of a register.

    Args:
        of: The register.
        data: The content of the register.

    Returns:
        The explanation, or the reason why the content is invalid. None if the register has no
        explanation.
    """
    decode = _EXPLANATIONS.get((of.address, of.size))
    if decode is None:
        return None
    try:
        return decode(data)
    except DecodeError as error:
        return error.message


def _word(data: bytes) -> int:
    return int.from_bytes(data, "little")


def _al_control(data: bytes) -> str:
    control = AlControl.from_word(_word(data))
    acknowledging = ", error acknowledged" if control.acknowledge else ""
    return f"{control.state} requested{acknowledging}"


def _al_status(data: bytes) -> str:
    status = AlStatus.from_word(_word(data))
    return (
        f"{status.state}, with an error: see AL status code" if status.error else f"{status.state}"
    )


def _al_status_code(data: bytes) -> str:
    code = status_code(_word(data))
    return f"{code.text}: {code.cause}" if code.cause else code.text


def _dl_status(data: bytes) -> str:
    status = DlStatus.from_word(_word(data))
    parts = [f"port {n}: {_port(status, n)}" for n in PORTS]
    parts.append("EEPROM loaded" if status.pdi_operational else "EEPROM not loaded")
    return "; ".join(parts)


def _port(status: DlStatus, number: int) -> str:
    port = status.ports[number]
    if port.communication:
        return "open" if not port.loop_closed else "communication, but loop closed"
    if port.link:
        return "link, no communication"
    return "no link" if port.loop_closed else "no link, but loop open"


def _dl_control(data: bytes) -> str:
    control = DlControl.from_word(_word(data))
    loops = ", ".join(f"port {n} {control.loops[n].name}" for n in PORTS)
    alien = "destroyed" if control.destroy_alien_frames else "forwarded"
    alias = "on" if control.alias_enabled else "off"
    return f"{loops}; non-EtherCAT frames {alien}; station alias {alias}"


def _owner(data: bytes) -> str:
    owner = "the device's processor (PDI)" if data[0] & CONFIGURATION_TO_PDI else "EtherCAT"
    forced = ", forced" if data[0] & CONFIGURATION_FORCE else ""
    return f"EEPROM assigned to {owner}{forced}"


def _flags(value: IntFlag) -> str:
    return ", ".join(str(each.name) for each in value) or "none"


def _information(data: bytes) -> str:
    found = decode_information(data)
    ports = ", ".join(f"port {n} {kind.name}" for n, kind in enumerate(found.ports))
    return (
        f"type 0x{found.type:02X} revision {found.revision} build {found.build}; "
        f"{found.fmmu_count} FMMUs, {found.sync_manager_count} SyncManagers, "
        f"{found.ram_size} KiB RAM; {ports}; {_flags(found.features)}"
    )


def _fmmu(data: bytes) -> str:
    found = decode_fmmu(data)
    if not found.enabled:
        return "off"
    directions = [text for on, text in ((found.reads, "inputs"), (found.writes, "outputs")) if on]
    return (
        f"{found.bit_length} bits of {' and '.join(directions) or 'nothing'}: logical "
        f"0x{found.logical_address:08X} bit {found.logical_start_bit}, physical "
        f"0x{found.physical_address:04X} bit {found.physical_start_bit}"
    )


def _sync_manager(data: bytes) -> str:
    found = decode_sync_manager(data)
    if Activation.ENABLE not in found.activation:
        return f"off ({found.length} bytes at 0x{found.address:04X})"
    direction = "MainDevice to device" if found.control.direction else "device to MainDevice"
    kind = found.control.buffering.name.lower().replace("_", " ")
    return (
        f"{kind}, {direction}: {found.length} bytes at 0x{found.address:04X}; "
        f"status {_flags(found.status)}; PDI {_flags(found.pdi_control)}"
    )


def _clock(data: bytes) -> str:
    found = decode_clock(data)
    return (
        f"system time {found.system_time_ns} ns, offset {found.offset_ns} ns, "
        f"delay {found.delay_ns} ns, difference {found.difference_ns} ns"
    )


def _rx_errors(data: bytes) -> str:
    return "; ".join(
        f"port {n}: {data[2 * n]} invalid frames, {data[2 * n + 1]} symbol errors" for n in PORTS
    )


def _error_counters(data: bytes) -> str:
    found = decode_error_counters(data)
    parts = [
        f"port {n}: {each.invalid_frames} invalid frames, {each.symbol_errors} symbol errors, "
        f"{each.forwarded} forwarded, {each.lost_links} lost links"
        for n, each in enumerate(found.ports)
        if each
    ]
    others = (("processing unit", found.processing_unit), ("PDI", found.pdi))
    parts += [f"{name}: {count}" for name, count in others if count]
    return "; ".join(parts) or "no errors"


def _per_port(data: bytes) -> str:
    return "; ".join(f"port {n}: {data[n]}" for n in PORTS)


def _times(data: bytes) -> str:
    return "; ".join(f"port {n}: {_word(data[4 * n : 4 * n + 4])} ns" for n in PORTS)


_SII_BITS = (
    ("write_enable", "write enable"),
    ("emulation", "EEPROM emulated by the processor"),
    ("eight_bytes", "8 bytes per read"),
    ("two_byte_address", "2 address bytes"),
    ("checksum_error", "checksum error"),
    ("not_loaded", "not loaded"),
    ("command_error", "no acknowledge or invalid command"),
    ("write_enable_error", "write enable missing"),
    ("busy", "busy"),
)


def _sii_control(data: bytes) -> str:
    status = ControlStatus.from_word(_word(data))
    bits = [text for name, text in _SII_BITS if getattr(status, name)]
    return ", ".join([f"command {status.command.name}", *bits])


_MEANINGS: tuple[tuple[AnyRegister, Explain], ...] = (
    (register.INFORMATION, _information),
    (register.DL_CONTROL, _dl_control),
    (register.DL_STATUS, _dl_status),
    (register.AL_CONTROL, _al_control),
    (register.AL_STATUS, _al_status),
    (register.AL_STATUS_CODE, _al_status_code),
    (register.ERROR_COUNTERS, _error_counters),
    (register.RX_ERROR_COUNTERS, _rx_errors),
    (register.FORWARDED_RX_ERROR_COUNTERS, _per_port),
    (register.LOST_LINK_COUNTERS, _per_port),
    (register.SII_CONFIGURATION, _owner),
    (register.SII_CONTROL_STATUS, _sii_control),
    (register.RECEIVE_TIMES, _times),
    (register.CLOCK_BLOCK, _clock),
    (register.SYSTEM_TIME_DIFFERENCE, lambda data: f"{decode_difference(_word(data))} ns"),
    (register.ACTIVATION, lambda data: _flags(SyncActivation(data[0]))),
    *((register.fmmu(k), _fmmu) for k in range(register.FMMU_COUNT)),
    *((register.sync_manager(k), _sync_manager) for k in range(register.SYNC_MANAGER_COUNT)),
)
_EXPLANATIONS = {(of.address, of.size): meaning for of, meaning in _MEANINGS}
