"""Access to unknown attributes fails, for reading and writing, before and while a loop is open."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import catenary as cat
from catenary.virtual import Coupler, DigitalInputs, DigitalOutputs, Segment, Servo


@pytest.fixture
def main() -> Iterator[cat.MainDevice]:
    devices = [Coupler(), DigitalOutputs(), DigitalInputs(), Servo()]
    with cat.MainDevice(Segment(devices)) as main:
        main.scan()
        yield main


def parts(main: cat.MainDevice) -> tuple[Any, Any, Any]:
    arm = cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=1.0)
    return arm, cat.Outputs(main.subs[1]), cat.Inputs(main.subs[2])


CASES: dict[str, tuple[Callable[[Any, Any, Any], Any], str, str]] = {
    "target": (lambda arm, out, inp: arm.target, "postion", "position"),
    "actual": (lambda arm, out, inp: arm.actual, "velocty", "velocity"),
    "drives": (lambda arm, out, inp: arm, "enabeld", "enabled"),
    "outputs": (lambda arm, out, inp: out, "bist", "bits"),
    "inputs": (lambda arm, out, inp: inp, "bist", "bits"),
}


@pytest.mark.parametrize("is_open", [False, True])
@pytest.mark.parametrize("case", CASES)
def test_a_misspelt_name_fails_with_the_nearest_one(
    main: cat.MainDevice, case: str, is_open: bool
) -> None:
    choose, wrong, right = CASES[case]
    requests = parts(main)

    def check() -> None:
        for use in (getattr, lambda owner, name: setattr(owner, name, 1)):
            with pytest.raises(AttributeError, match=f"no attribute '{wrong}'.*'{right}'"):
                use(choose(*requests), wrong)

    if not is_open:
        return check()
    with cat.Loop(*requests, period=1e-3):
        check()


def test_channels_are_written_as_a_whole_or_by_element(main: cat.MainDevice) -> None:
    _, out, inputs = parts(main)
    with pytest.raises(RuntimeError, match="Outputs have no values before a Loop is open"):
        out.bits = [1, 1, 1, 1]
    with cat.Loop(out, inputs, period=1e-3):
        array = out.bits
        out.bits = [1, 0, 1, 1]
        assert out.bits is array
        assert array.tolist() == [1, 0, 1, 1]
        out.bits[:] = 0
        assert not out.bits.any()
        with pytest.raises(ValueError, match="broadcast"):
            out.bits = np.ones(3)
        with pytest.raises(AttributeError, match="inputs are read-only"):
            inputs.bits = [1, 1, 1, 1]


def test_arrays_of_drives_are_written_into(main: cat.MainDevice) -> None:
    arm, _, _ = parts(main)
    with pytest.raises(AttributeError, match=r"Drives\.target is read-only"):
        arm.target = 1
    with pytest.raises(AttributeError, match=r"Drives\.enable is a method: call it, enable\(...\)"):
        arm.enable = True
    with cat.Loop(arm, period=1e-3), pytest.raises(AttributeError, match="write into the array"):
        arm.target.position = 0.1


def test_a_terminal_is_not_a_drive(main: cat.MainDevice) -> None:
    with pytest.raises(ValueError, match=r"device 1 \(.*\) is not a drive: .* Inputs or Outputs"):
        cat.Drives([main.subs[1]], counts_per_turn=2**20)
