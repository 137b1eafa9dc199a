"""Devices by kind and by alias."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.bus.sub_devices import SubDevices
from catenary.errors import SegmentError, StateError
from catenary.procedure.registers import write_register
from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo
from catenary.wire.al import AlState


def positions(subs: tuple[cat.SubDevice, ...]) -> list[int]:
    return [sub.position for sub in subs]


def test_a_group_ends_before_the_next_alias() -> None:
    devices = [Coupler(), Servo(alias=10), DigitalOutputs(), Servo(), Coupler(alias=20), Servo()]
    with cat.MainDevice(Segment(devices)) as main:
        subs = main.scan()
        assert positions(subs.group(10)) == [1, 2, 3]
        assert positions(subs.group(20)) == [4, 5]
        assert subs.group(30) == ()
        assert positions(subs.drives) == [1, 3, 5]
        with pytest.raises(ValueError, match="0 means that a device has no alias"):
            subs.group(0)


def test_a_duplicate_alias_is_refused() -> None:
    with cat.MainDevice(Segment([Servo(alias=7), Servo(alias=7)])) as main:
        subs = main.scan()
        with pytest.raises(SegmentError, match="devices 0, 1 have the same alias 7"):
            subs.group(7)


def test_a_device_is_found_by_its_name_or_order_code() -> None:
    with cat.MainDevice(Segment([Coupler(), Servo(name="shoulder"), DigitalOutputs()])) as main:
        subs = main.scan()
        assert subs["shoulder"].position == 1
        assert subs["CVK100"].position == 0
        with pytest.raises(SegmentError, match=r"no device has the name .* 'sholder'") as caught:
            subs["sholder"]
        assert caught.value.hint == "known names: 'shoulder'"


def test_a_name_of_several_devices_is_refused_with_their_positions() -> None:
    with cat.MainDevice(Segment([Servo(), Coupler(), Servo()])) as main:
        subs = main.scan()
        with pytest.raises(SegmentError, match=r"2 devices have the name 'CVS001': positions 0, 2"):
            subs["CVS001"]


def test_a_device_is_found_by_its_alias() -> None:
    with cat.MainDevice(Segment([Coupler(), Servo(alias=10)])) as main:
        subs = main.scan()
        assert subs.by_alias(10).position == 1
        with pytest.raises(SegmentError, match="no device has the alias 11") as caught:
            subs.by_alias(11)
        assert "10 (" in caught.value.hint


def test_a_position_that_does_not_exist_names_the_number_of_devices() -> None:
    with cat.MainDevice(Segment([Coupler(), Servo()])) as main:
        subs = main.scan()
        assert subs[-1].position == 1
        with pytest.raises(IndexError, match=r"no device 99: the segment has 2 devices, 0 to 1"):
            subs[99]
    with pytest.raises(IndexError, match=r"the segment has 0 devices$"):
        SubDevices()[0]


@pytest.mark.parametrize("state", ["SAFE_OP", "safeop", AlState.SAFE_OP])
def test_a_device_is_brought_to_a_state(state: AlState | str) -> None:
    with cat.MainDevice(Segment([Coupler(), Servo()])) as main:
        servo = main.scan()[1]
        assert servo.request_state(state).state is AlState.SAFE_OP
        assert servo.read_state().state is servo.state is AlState.SAFE_OP
        assert servo.request_state("PREOP").state is AlState.PRE_OP
        with pytest.raises(ValueError, match="invalid state 'RUN': INIT, PRE-OP"):
            servo.request_state("RUN")


def test_a_refused_state_is_an_error_of_the_device() -> None:
    with cat.MainDevice(Segment([Coupler(), Servo()])) as main:
        servo = main.scan()[1]
        with pytest.raises(StateError, match="servo"):
            servo.request_state("OP")  # without process data


def test_a_device_with_emulation_recovers_from_a_copied_error_bit() -> None:
    """A device without a microcontroller copies AL control to AL status, also its error bit."""
    with cat.MainDevice(Segment([DigitalOutputs()])) as main:
        outputs = main.scan()[0]
        main.converse(write_register(outputs.station, 0x0120, bytes((0x12, 0))))
        assert outputs.read_state().error
        outputs.request_state("SAFEOP")
        now = outputs.read_state()
        assert (now.state, now.error) == (AlState.SAFE_OP, False)


def test_a_notebook_shows_a_table() -> None:
    with cat.MainDevice(Segment([Coupler(), Servo(name="a<b>", alias=7)])) as main:
        html = main.scan()._repr_html_()
    assert html.count("<tr>") == 3
    assert "<th>position</th>" in html
    assert "<td>a&lt;b&gt;</td>" in html
    assert "<td>7</td><td>PRE-OP</td>" in html
