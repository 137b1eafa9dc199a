"""Texts of faults and stops, and the rate limit."""

from __future__ import annotations

from catenary.dashboard.status import AxisNotes
from catenary.plan.stop_reason import StopReason
from catenary.share import SharedEvent


def stopped(axis: str, reason: StopReason) -> SharedEvent:
    details = {"axis": axis, "reason": int(reason), "cycle": 5}
    return SharedEvent(1, 5, "AxisStopped", "the message", 0.1, 2, details)


def test_a_stop_reason_lasts_until_the_axis_is_enabled_again() -> None:
    notes = AxisNotes()
    notes.add(stopped("j1", StopReason.DEVICE_LOST))
    assert notes.stop_reason("j1", enabled=False) == StopReason.DEVICE_LOST.text
    assert notes.stop_reason("j2", enabled=False) == ""
    assert notes.stop_reason("j1", enabled=True) == ""
    assert notes.stop_reason("j1", enabled=False) == ""


def test_the_stop_of_an_operator_has_a_text() -> None:
    notes = AxisNotes()
    notes.add(stopped("j1", StopReason.OPERATOR))
    assert "operator" in notes.stop_reason("j1", enabled=False)


def test_an_unknown_reason_has_the_message_of_the_event() -> None:
    notes = AxisNotes()
    notes.add(SharedEvent(1, 5, "AxisStopped", "the message", 0.1, 2, {"axis": "j1", "reason": 99}))
    assert notes.stop_reason("j1", enabled=False) == "the message"


def test_a_fault_has_the_text_of_the_emergency_of_its_device() -> None:
    notes = AxisNotes()
    assert notes.fault("j1") == "the drive is in fault"
    notes.add(SharedEvent(1, 5, "Emergency", "emergency 0x8611", 0.1, 2, {}))
    assert notes.fault("j1") == "the drive is in fault"
    notes.devices = {"j1": 2}
    assert notes.fault("j1") == "emergency 0x8611"
