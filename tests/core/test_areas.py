"""Areas: bytes of an image that the application uses without conversion."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.plan.cycle import Bank, Column, ImageArea, Number, NumberKind
from tests.core.rig import DRIVE_SIZE as SIZE
from tests.core.rig import Bench, ScriptedDrive, axis, make_plan
from tests.core.test_law import Frame, make_law
from tests.core.test_numbers import Echo

EXECUTIONS = ("threaded", "inline")


def area(offset: int, size: int) -> ImageArea:
    return ImageArea("x", offset, size, 0, 0, bytes(size))


def echo(*areas: ImageArea) -> Echo:
    return Echo(replace(make_plan([], units=1), output_areas=areas, input_areas=areas))


def test_bytes_go_out_and_come_back_as_they_are() -> None:
    b = echo(area(3, 2), area(0, 1))
    assert len(b.engine.buffers["output_bytes"]) == 3
    b.output_bytes[:] = (0xAB, 0xCD, 0xEF)
    b.engine.run(1)
    assert b.outputs[:5] == b"\xef\x00\x00\xab\xcd"
    assert b.input_bytes.tolist() == [0xAB, 0xCD, 0xEF]


def test_inputs_are_read_only_and_constant_between_two_cycles() -> None:
    b = echo(area(0, 1))
    with pytest.raises(ValueError, match="read-only"):
        b.input_bytes[0] = 1
    b.output_bytes[0] = 5
    assert b.input_bytes[0] == 0
    b.engine.run(1)
    assert b.input_bytes[0] == 5


def test_a_number_next_to_an_area_is_unchanged() -> None:
    number = Column("n", Number(8, 16, NumberKind.UNSIGNED), Bank.INTEGER, 0, 0)
    areas = (area(0, 1), area(3, 1))
    b = Echo(replace(make_plan([], units=1), output_areas=areas, output_columns=(number,)))
    b.output_bytes[:] = (1, 2)
    b.output_integers[0] = 0x0403
    b.engine.run(1)
    assert b.outputs[:4] == b"\x01\x03\x04\x02"


@pytest.mark.parametrize("place", [(0, SIZE + 1), (SIZE, 1), (-1, 1), (0, -1)])
def test_an_area_outside_of_the_image_is_refused(place: tuple[int, int]) -> None:
    wrong = ImageArea("x", *place, 0, 0)
    with pytest.raises(ValueError, match=r"area x: bytes .* exceed the image"):
        Echo(replace(make_plan([], units=1), output_areas=(wrong,)))


@pytest.mark.parametrize("execution", EXECUTIONS)
def test_while_a_law_runs_the_bytes_are_still_the_applications(
    execution: str,
) -> None:
    plan = make_plan([axis(0)], units=2, execution=execution)
    own = ImageArea("x", plan.output_size - 1, 1, 1, 0, b"\0")
    sent: list[int] = []

    class Observed(ScriptedDrive):
        def exchange(self, outputs: bytes) -> bytes:
            sent.append(outputs[-1])
            return super().exchange(outputs)

    b = Bench(replace(plan, output_areas=(own,)), [ScriptedDrive(), Observed()])

    def nothing(frame: Frame) -> int:
        return 0

    b.engine.start_law(make_law(b, nothing))
    b.steps(5)
    b.output_bytes[0] = 9
    b.steps(5)
    assert sent[-1] == 9
    assert sent[-7] == 0
