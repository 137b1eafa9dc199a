"""A device that cannot be brought to PRE-OP: named, told when it is used, no harm to the others."""

import pytest

import catenary as cat
from catenary.errors import CatenaryError, StateError
from catenary.wire.al import State

REFUSED = 0x0016  # invalid mailbox configuration, PRE-OP


@pytest.fixture
def segment() -> cat.Segment:
    segment = cat.Segment([cat.Coupler(), cat.Servo(), cat.Servo(), cat.DigitalOutputs()])
    segment[1].refuse_state(State.PRE_OP, REFUSED)
    return segment


def test_strict_it_is_raised_and_the_others_are_there(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        with pytest.raises(StateError, match="device 1") as caught:
            main.scan()
        assert caught.value.position == 1
        assert [sub.state for sub in main.subs] == [
            State.PRE_OP,
            None,
            State.PRE_OP,
            State.PRE_OP,
        ]
        assert [device.state for device in segment][2:] == [2, 2]


def test_else_it_is_raised_when_the_device_is_used(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        subs = main.scan(strict=False)
        assert isinstance(subs[1].error, StateError)
        assert subs[1].identity == subs[2].identity  # what could be read is known
        assert subs[2].error is None
        assert subs[2].sdo.read(0x1018, 1)
        with pytest.raises(StateError, match="device 1"):
            subs[1].sdo.read(0x1018, 1)
        arm = cat.Drives([subs[2]], counts_per_turn=2**20, velocity_limit=100.0)
        with pytest.raises(StateError, match="device 1"), cat.Loop(arm):
            pass


def test_mended_and_scanned_again_it_is_whole(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        before = main.scan(strict=False)[2]
        segment[1].refuse_state(State.PRE_OP, None)
        subs = main.scan()
        assert subs[2] is before
        assert [sub.error for sub in subs] == [None] * 4
        assert [sub.state for sub in subs] == [State.PRE_OP] * 4


def test_further_ones_are_notes(segment: cat.Segment) -> None:
    segment[2].refuse_state(State.PRE_OP, REFUSED)
    with cat.MainDevice(segment) as main:
        with pytest.raises(CatenaryError, match="device 1") as caught:
            main.scan()
        assert any("device 2" in note for note in caught.value.__notes__)
