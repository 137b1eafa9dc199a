"""Numbers at any bit offset, read and written through columns, compared with Python's integers."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.core import CYCLE_LIMITED, CYCLE_REFUSED, Engine
from catenary.plan.cycle import Bank, Column, Number, NumberKind
from tests.core.rig import DRIVE_SIZE, Bench, make_plan

SIZE = DRIVE_SIZE


class Echo(Bench):
    """Sends its outputs back as inputs, so that what is written can be read."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.outputs = bytes(SIZE)
        self.background = bytes(SIZE)
        drive = self.drives[0]
        drive.exchange = self.exchange  # type: ignore[method-assign]

    def exchange(self, outputs: bytes) -> bytes:
        self.outputs = outputs
        return outputs


def column(number: Number, bank: Bank) -> tuple[Column, ...]:
    return (Column("x", number, bank, 0, 0),)


def echo(number: Number, bank: Bank) -> Echo:
    columns = column(number, bank)
    plan = make_plan([], units=1)
    return Echo(replace(plan, output_columns=columns, input_columns=columns))


@st.composite
def placed(draw: st.DrawFn) -> tuple[int, int]:
    bits = draw(st.integers(1, 64))
    return draw(st.integers(0, SIZE * 8 - bits)), bits


@settings(max_examples=150, deadline=None)
@given(placed(), st.booleans(), st.integers(-(2**63), 2**63 - 1))
def test_integers_at_any_place(place: tuple[int, int], signed: bool, value: int) -> None:
    """What is out of range is cut to it; 64 bits take everything."""
    offset, bits = place
    kind = NumberKind.SIGNED if signed else NumberKind.UNSIGNED
    b = echo(Number(offset, bits, kind), Bank.INTEGER)
    b.output_integers[0] = value
    flags = b.engine.run(1)
    expected = value
    if bits < 64:
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
        expected = min(max(value, low), high)
    assert int.from_bytes(b.outputs, "little") == expected % 2**bits << offset
    assert b.input_integers[0] == expected
    assert bool(flags & CYCLE_LIMITED) == (value != expected)


def test_an_integer_out_of_range_does_not_go_round() -> None:
    b = echo(Number(0, 16, NumberKind.SIGNED), Bank.INTEGER)
    b.output_integers[0] = 40_000
    assert b.engine.run(1) & CYCLE_LIMITED
    assert b.input_integers[0] == 32_767


def test_the_neighbours_of_a_field_stay() -> None:
    numbers = [Number(3, 5, NumberKind.UNSIGNED), Number(8, 64, NumberKind.UNSIGNED)]
    numbers += [Number(72 + 3, 7, NumberKind.UNSIGNED), Number(0, 3, NumberKind.UNSIGNED)]
    columns = tuple(Column(str(n), n, Bank.INTEGER, 0, 0) for n in numbers)
    b = Echo(replace(make_plan([], units=1), output_columns=columns, input_columns=columns))
    b.output_integers[:] = (0b10101, -1, 0b1011011, 0b110)
    b.engine.run(1)
    assert b.input_integers.tolist() == [0b10101, -1, 0b1011011, 0b110]
    b.output_integers[1] = 0
    b.engine.run(1)
    assert b.input_integers.tolist() == [0b10101, 0, 0b1011011, 0b110]


@pytest.mark.parametrize("offset", [0, 5, 40])
@pytest.mark.parametrize(("bits", "code"), [(32, "<f"), (64, "<d")])
def test_real_numbers(offset: int, bits: int, code: str) -> None:
    b = echo(Number(offset, bits, NumberKind.REAL, 2.0, 1.0), Bank.REAL)
    b.output_reals[0] = -6.5
    b.engine.run(1)
    raw = int.from_bytes(struct.pack(code, -3.75), "little")
    assert int.from_bytes(b.outputs, "little") == raw << offset
    assert b.input_reals[0] == -6.5


@pytest.mark.parametrize(
    ("kind", "bits", "low", "high"),
    [
        (NumberKind.SIGNED, 16, -(2**15), 2**15 - 1),
        (NumberKind.UNSIGNED, 12, 0, 2**12 - 1),
        (NumberKind.SIGNED, 64, -(2**63), 2**63 - 1024),
        (NumberKind.UNSIGNED, 64, 0, 2**64 - 2048),
        (NumberKind.SIGNED, 60, -(2**59), 2**59 - 64),
    ],
)
def test_si_values_are_scaled_rounded_and_cut(
    kind: NumberKind, bits: int, low: int, high: int
) -> None:
    b = echo(Number(4, bits, kind, 0.5, 10.0), Bank.REAL)
    b.output_reals[0] = 15.3
    assert not b.engine.next() & CYCLE_LIMITED
    assert b.input_reals[0] == 15.5
    for value, raw in ((1e30, high), (-1e30, low)):
        b.output_reals[0] = value
        assert b.engine.next() & CYCLE_LIMITED
        assert b.input_reals[0] == raw * 0.5 + 10.0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_column_that_is_not_finite_keeps_what_was_sent(value: float) -> None:
    b = echo(Number(0, 16, NumberKind.SIGNED), Bank.REAL)
    b.output_reals[0] = 77
    b.engine.next()
    b.output_reals[0] = value
    assert b.engine.next() & CYCLE_REFUSED
    assert b.input_reals[0] == 77


@pytest.mark.parametrize("bits", [1, 8])
def test_bits(bits: int) -> None:
    b = echo(Number(13, bits, NumberKind.UNSIGNED), Bank.BIT)
    b.output_bits[0] = 200
    b.engine.run(1)
    assert (int.from_bytes(b.outputs, "little"), b.input_bits[0]) == (1 << 13, 1)
    b.output_bits[0] = 0
    b.engine.run(1)
    assert (int.from_bytes(b.outputs, "little"), b.input_bits[0]) == (0, 0)


@pytest.mark.parametrize(
    ("number", "bank", "message"),
    [
        (Number(-1, 8, NumberKind.SIGNED), Bank.REAL, "exceed the image"),
        (Number(SIZE * 8 - 7, 8, NumberKind.SIGNED), Bank.REAL, "exceed the image"),
        (Number(0, 0, NumberKind.SIGNED), Bank.REAL, "0 bits"),
        (Number(0, 65, NumberKind.SIGNED), Bank.REAL, "65 bits"),
        (Number(0, 16, NumberKind.REAL), Bank.REAL, "16 bits"),
        (Number(0, 16, NumberKind.SIGNED, 0.0), Bank.REAL, "scale"),
        (Number(0, 16, NumberKind.SIGNED, float("nan")), Bank.REAL, "scale"),
        (Number(0, 16, NumberKind.SIGNED, 1.0, float("inf")), Bank.REAL, "offset"),
        (Number(0, 32, NumberKind.REAL), Bank.INTEGER, "real bank"),
        (Number(0, 16, 7), Bank.REAL, "kind"),  # type: ignore[arg-type]
        (Number(0, 16, NumberKind.SIGNED), 9, "bank"),
    ],
)
def test_impossible_numbers_name_the_column(number: Number, bank: Bank, message: str) -> None:
    plan = replace(make_plan([], units=1), input_columns=column(number, bank))
    echo = Echo(make_plan([], units=1))
    with pytest.raises(ValueError, match=f"column x.*{message}"):
        Engine(plan, echo.link.capsule)
