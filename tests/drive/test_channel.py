"""Channels: conversion between raw bits and values."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary import types
from catenary.drive import Channel
from catenary.drive.channel import channel_of, make_channel
from catenary.model.device import Entry
from catenary.plan.cycle import Bank, NumberKind

INTEGERS = [kind for kind in types.ALL if isinstance(kind, types.Integer) and kind.bit_length <= 64]


@given(st.sampled_from(INTEGERS), st.data())
def test_integers_round_trip(kind: types.Integer, data: st.DataObject) -> None:
    value = data.draw(st.integers(kind.minimum, kind.maximum))
    channel = Channel(0x6000, 1, kind)
    raw = channel.encode(value)
    assert 0 <= raw < 1 << kind.bit_length
    assert channel.decode(raw) == value


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_reals_round_trip(value: float) -> None:
    channel = Channel(0x6000, 1, types.REAL)
    assert channel.decode(channel.encode(value)) == value


def test_a_scale_makes_floats() -> None:
    channel = Channel(0x6000, 0x11, types.INT, 0.5, unit="m/s2")
    assert channel.decode(0xFFFF) == -0.5
    assert channel.encode(-0.6) == 0xFFFF
    assert channel.bank is Bank.REAL
    assert channel.kind is NumberKind.SIGNED


def test_booleans_are_booleans() -> None:
    channel = Channel(0x7000, 1, types.BOOL)
    assert channel.decode(1) is True
    assert channel.encode(True) == 1
    assert channel.encode(0) == 0
    assert Channel(0x7000, 1, types.BOOL, 5.0).encode(5.0) == 1
    assert channel.bank is Bank.BIT


@pytest.mark.parametrize(
    ("kind", "value", "error"),
    [
        (types.USINT, 256, ValueError),
        (types.USINT, -1, ValueError),
        (types.USINT, 1.5, TypeError),
        (types.REAL, math.nan, ValueError),
        (types.REAL, 1e39, ValueError),
    ],
)
def test_a_value_out_of_range_is_refused(
    kind: types.Integer, value: float, error: type[Exception]
) -> None:
    with pytest.raises(error):
        Channel(0x7000, 1, kind).encode(value)


@pytest.mark.parametrize("value", [float("inf"), float("nan")])
@pytest.mark.parametrize("kind", [types.INT, types.REAL])
def test_a_scaled_value_must_be_finite(kind: types.Integer | types.Real, value: float) -> None:
    with pytest.raises(ValueError, match="is not finite"):
        Channel(0x7000, 1, kind, 0.1).encode(value)


def test_an_invalid_channel_is_named() -> None:
    with pytest.raises(
        TypeError, match=r"inputs\['force'\] is 5; give a Channel or \(index, subindex"
    ):
        make_channel("inputs", "force", 5)  # type: ignore[arg-type]
    with pytest.raises(
        TypeError, match=r"inputs\['x'\]: 0x6000:01: VISIBLE_STRING is not a numeric type"
    ):
        make_channel("inputs", "x", (0x6000, 1, types.VISIBLE_STRING))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="the index must be from 1 to 0xFFFF"):
        make_channel("inputs", "x", (0x16000, 1, types.INT))
    with pytest.raises(ValueError, match="scale 0"):
        make_channel("inputs", "x", (0x6000, 1, types.INT, 0.0))


@pytest.mark.parametrize(
    ("entry", "kind", "bits"),
    [
        (Entry(0x6000, 1, 32, "", 0x08), NumberKind.REAL, 32),
        (Entry(0x6000, 1, 12, "", 0x03), NumberKind.SIGNED, 12),
        (Entry(0x6000, 1, 12, "", 0), NumberKind.UNSIGNED, 12),
        (Entry(0x6000, 1, 16, "", 0x08), NumberKind.UNSIGNED, 16),
    ],
)
def test_the_type_of_a_mapped_entry(entry: Entry, kind: NumberKind, bits: int) -> None:
    channel = channel_of(entry)
    assert (channel.kind, channel.bit_length) == (kind, bits)
