"""Comparison of the registers that two bring-ups leave in a device."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from catenary.capture.difference import Difference, Topic, level, mark_of
from catenary.capture.mapped_areas import MappedArea
from catenary.capture.register_contents import RegisterWrite, SyncManagerWrite
from catenary.capture.settings import Setting, SyncUnit
from catenary.capture.text import duration
from catenary.wire.al import AlState
from catenary.wire.register import (
    WATCHDOG_DIVIDER,
    WATCHDOG_TIME_PDI,
    WATCHDOG_TIME_PROCESS_DATA,
)
from catenary.wire.register_names import at_address
from catenary.wire.sync_manager import WATCHDOG_TRIGGER

_DIRECTION_AND_MODE, _INTERRUPT_PDI = 0x0F, 0x20  # of a SyncManager's control byte
_RESET_VALUES = {  # Beckhoff's ESC data sheet, section II
    WATCHDOG_DIVIDER.address: 0x09C2,
    WATCHDOG_TIME_PDI.address: 0x03E8,
    WATCHDOG_TIME_PROCESS_DATA.address: 0x03E8,
}
_LABEL = "AssignActivate "


def compare_settings(
    a: Mapping[tuple[str, int], Setting], b: Mapping[tuple[str, int], Setting]
) -> Iterator[Difference]:
    """Yield a row for each register block whose last values differ.

    Args:
        a: Settings of A by their keys.
        b: Settings of B by their keys.
    """
    for key in dict.fromkeys((*a, *b)):
        left, right = a.get(key), b.get(key)
        row = _difference(left, right)
        if row is not None:
            yield row


def _difference(a: Setting | None, b: Setting | None) -> Difference | None:
    present = a or b
    assert present is not None
    if a and b:
        if not (parts := _differing(a, b)):
            return None
        subject, effect, note = parts[0]
        effect = any(part[1] for part in parts)
        note = note if len(parts) == 1 else ""
    elif _is_reset_value(present):
        return None  # the register has this value without a write
    else:
        subject, effect, note = _alone(present)
    topic = Topic.WATCHDOG if subject.endswith("watchdog trigger") else present.topic
    return Difference(
        mark_of(a, b),
        topic,
        subject,
        present.step,
        _text(a),
        _text(b).replace(_LABEL, "") if a else _text(b),
        effect,
        note,
        a.packet if a else None,
        b.packet if b else None,
    )


def _differing(a: Setting, b: Setting) -> list[tuple[str, bool, str]]:
    """Return the differing parts: name, effect, note."""
    found: list[tuple[str, bool, str]] = []
    left, right = a.value, b.value
    if isinstance(left, SyncManagerWrite) and isinstance(right, SyncManagerWrite):
        found = _sync_manager(left, right)
    elif isinstance(left, SyncUnit) and isinstance(right, SyncUnit):
        found = [
            (name, True, "")
            for name, one, other in (
                ("AssignActivate", left.assign_activate, right.assign_activate),
                ("SYNC0 cycle time", left.sync0_ns, right.sync0_ns),
                ("SYNC1 cycle time", left.sync1_ns, right.sync1_ns),
            )
            if one != other
        ]
    elif isinstance(left, MappedArea) and isinstance(right, MappedArea):
        if left != right:
            part = "address" if left.first_bit != right.first_bit else "length"
            found = [(f"FMMU {part}", not left.is_status, "")]
    elif isinstance(left, RegisterWrite) and left != right:
        found = [(_register_name(left), True, "")]
    if not found and _is_late(a) is not _is_late(b):
        late = "A" if _is_late(a) else "B"
        found = [(_name(a), False, f"not before SAFE-OP in {late}")]
    return found


def _sync_manager(a: SyncManagerWrite, b: SyncManagerWrite) -> list[tuple[str, bool, str]]:
    changed = a.control ^ b.control
    off = "B" if a.watchdog else "A"
    parts = (
        ("length", a.length != b.length, True, ""),
        ("address", a.address != b.address, True, ""),
        ("direction or mode", changed & _DIRECTION_AND_MODE, True, ""),
        (
            "watchdog trigger",
            changed & WATCHDOG_TRIGGER,
            True,
            f"watchdog trigger off in {off}",
        ),
        ("PDI interrupt", changed & _INTERRUPT_PDI, True, ""),
        ("control", changed, False, ""),
    )
    found = [
        (f"SM{a.number} {name}", effect, note) for name, differs, effect, note in parts if differs
    ]
    return found[:-1] if len(found) > 1 and changed else found


def _alone(setting: Setting) -> tuple[str, bool, str]:
    """Return the name, the effect and a note for a value that only one capture has."""
    value = setting.value
    if isinstance(value, MappedArea) and value.is_status:
        return _name(setting), False, "status of a mailbox"
    return _name(setting), True, ""


def _is_reset_value(setting: Setting) -> bool:
    value = setting.value
    if not isinstance(value, RegisterWrite):
        return False
    return _RESET_VALUES.get(value.address) == int.from_bytes(value.data, "little")


def _name(setting: Setting) -> str:
    value = setting.value
    if isinstance(value, SyncManagerWrite):
        return f"SM{value.number}"
    if isinstance(value, SyncUnit):
        return "AssignActivate"
    if isinstance(value, RegisterWrite):
        return _register_name(value)
    return "FMMU"


def _register_name(write: RegisterWrite) -> str:
    found = at_address(write.address, len(write.data)) or at_address(write.address)
    return found.name if found else f"register 0x{write.address:04X}"


def _text(setting: Setting | None) -> str:
    if setting is None:
        return ""
    value = setting.value
    if not isinstance(value, SyncUnit):
        return str(value)
    times = f"SYNC0 {duration(value.sync0_ns)}"
    if value.sync1_ns:
        times += f"  SYNC1 {duration(value.sync1_ns)}"
    return f"{times}  {_LABEL}0x{value.assign_activate:04X}"


def _is_late(setting: Setting) -> bool:
    return level(setting.step.before) >= level(AlState.SAFE_OP)
