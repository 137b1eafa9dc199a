"""Operating mode of a share, as its readers see it."""

from __future__ import annotations

import os

import pytest

import catenary as cat
from catenary.errors import ShareError
from catenary.share.layout import ShareLayout, decode_head, decode_mode
from catenary.virtual import Coupler, Segment, Servo
from tests.share.names import state_file

MODES = ("damping", "stand")


def test_an_operating_mode_is_not_the_permissions(name: str) -> None:
    with pytest.raises(TypeError, match=r"mode='stand': .* modes="):
        cat.Share(name, mode="stand")  # type: ignore[arg-type]


def test_readers_see_the_modes_the_present_mode_and_an_event_of_each_change(name: str) -> None:
    with (
        cat.MainDevice(Segment([Coupler(), Servo()])) as main,
        cat.Share(name, modes=MODES, presets={"wave": "wave twice"}) as share,
    ):
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3, sink=share) as loop, cat.attach(name) as reader:
            assert [each.name for each in reader.layout.modes] == list(MODES)
            assert reader.layout.presets[0].description == "wave twice"
            assert reader.mode is None
            next(loop)
            share.mode = "damping"
            next(loop)
            share.mode = "damping"  # no change, no event
            share.mode = "stand"
            assert reader.mode == share.mode == "stand"
            found = [each for each in reader.events()[0] if each.kind == "ModeChanged"]
            assert [each.message for each in found] == [
                "operating mode 'damping'",
                "operating mode 'stand', after 'damping'",
            ]
            assert found[1].time > found[0].time
            assert found[1].details == {"mode": "stand", "before": "damping"}


def test_a_mode_that_was_set_before_the_loop_is_published(name: str) -> None:
    with cat.MainDevice(Segment([Coupler(), Servo()])) as main:
        share = cat.Share(name, modes=MODES)
        share.mode = "stand"
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with share, cat.Loop(arm, period=1e-3, sink=share), cat.attach(name) as reader:
            assert reader.mode == "stand"


def test_a_share_without_modes_has_none(name: str) -> None:
    with cat.MainDevice(Segment([Coupler(), Servo()])) as main, cat.Share(name) as share:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3, sink=share), cat.attach(name) as reader:
            assert (reader.mode, reader.layout.modes, reader.layout.presets) == (None, (), ())
            assert share.requests() == ()
            with pytest.raises(ValueError, match="the program offers no modes"):
                share.mode = "stand"
        assert share.mode is None


def test_a_forked_child_cannot_change_the_mode(name: str) -> None:
    with cat.Share(name, modes=MODES) as share:
        pid = os.fork()
        if pid == 0:
            try:
                share.mode = "stand"
            except RuntimeError:
                os._exit(0)
            finally:
                os._exit(1)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
        assert share.mode is None


def test_a_damaged_mode_is_an_error(name: str) -> None:
    with cat.MainDevice(Segment([Coupler(), Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Share(name, modes=MODES) as share, cat.Loop(arm, period=1e-3, sink=share):
            image = bytearray(state_file(name).read_bytes())
            layout: ShareLayout = decode_head(bytes(image), len(image))
            image[layout.mode_offset] = 3
            with pytest.raises(ShareError, match="mode 3 of 2"):
                decode_mode(image, layout)  # type: ignore[arg-type]


def test_permissions_are_the_argument_mode(name: str) -> None:
    assert cat.Share(name, mode=0o640).permissions == 0o640
