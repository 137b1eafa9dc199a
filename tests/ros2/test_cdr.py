"""Tests of the CDR codec against rosbags and with damaged messages."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import Struct

from catenary.errors import DecodeError
from catenary.ros2 import cdr
from catenary.ros2.messages import (
    MESSAGE_TYPES,
    DiagnosticArray,
    Float64MultiArray,
    Header,
    Imu,
    Int64,
    JointState,
    JointTrajectory,
    String,
    Time,
    message_type,
)
from tests.ros2.examples_of_messages import EXAMPLES, HEADER

typesys = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed")
DISTRIBUTIONS = ("ROS2_JAZZY", "ROS2_KILTED")


def names_of(message: Struct) -> str:
    return type(message).__name__


def as_rosbags(value: Any, store: Any, name: str) -> Any:
    """Return a message as an object of the class of rosbags."""
    fields = {}
    for field, (kind, detail) in store.fielddefs[name][1]:
        fields[field] = convert(getattr(value, field), store, int(kind), detail)
    return store.types[name](**fields)


def convert(value: Any, store: Any, kind: int, detail: Any) -> Any:
    if kind == 1:
        return value
    if kind == 2:
        return as_rosbags(value, store, detail)
    (element, element_detail), _ = detail
    if int(element) == 1 and element_detail[0] != "string":
        return np.array(value, dtype=element_detail[0])
    return [convert(item, store, int(element), element_detail) for item in value]


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize("message", EXAMPLES, ids=names_of)
def test_encodes_as_rosbags(message: Struct, distribution: str) -> None:
    store = typesys.get_typestore(typesys.Stores[distribution])
    name = message_type(type(message)).name
    expected = store.serialize_cdr(as_rosbags(message, store, name), name)
    assert cdr.encode(message) == bytes(expected)


@pytest.mark.parametrize("message", EXAMPLES, ids=names_of)
def test_decodes_what_it_encodes(message: Struct) -> None:
    assert cdr.decode(cdr.encode(message), type(message)) == message


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize("kind", MESSAGE_TYPES, ids=lambda kind: kind.struct.__name__)
def test_type_hashes_are_those_of_rosbags(kind: Any, distribution: str) -> None:
    store = typesys.get_typestore(typesys.Stores[distribution])
    assert kind.rihs == store.hash_rihs01(kind.name)


def test_every_message_type_has_an_example() -> None:
    assert {type(example) for example in EXAMPLES} == {kind.struct for kind in MESSAGE_TYPES}


def test_layout_of_a_message() -> None:
    """Compute the bytes of a JointState by hand from XCDR1's rules of alignment."""
    message = JointState(Header(Time(1, 2), "ab"), ("x",), (1.0,))
    assert cdr.encode(message).hex(" ") == (
        "00 01 00 00 01 00 00 00 02 00 00 00 03 00 00 00 61 62 00 00 "  # stamp, frame
        "01 00 00 00 02 00 00 00 78 00 00 00 "  # name
        "01 00 00 00 00 00 00 00 00 00 f0 3f "  # position, already on a multiple of 8
        "00 00 00 00 00 00 00 00"  # velocity, effort
    )


def test_an_array_is_encoded_as_a_sequence() -> None:
    array = Float64MultiArray(data=np.array([1.0, 2.0]))  # type: ignore[arg-type]
    assert cdr.encode(array) == cdr.encode(Float64MultiArray(data=(1.0, 2.0)))


@pytest.mark.parametrize(
    "message",
    [
        Int64(2**63),
        String("a\0b"),
        Imu(orientation_covariance=(0.0,) * 8),
        JointState(name="abc"),
        JointState(position=("x",)),  # type: ignore[arg-type]
        Header(None, ""),  # type: ignore[arg-type]
    ],
)
def test_refuses_a_value_that_does_not_fit(message: Struct) -> None:
    with pytest.raises(ValueError, match=type(message).__name__):
        cdr.encode(message)


@pytest.mark.parametrize("message", EXAMPLES, ids=names_of)
def test_refuses_a_cut_message(message: Struct) -> None:
    data = cdr.encode(message)
    for end in range(len(data)):
        with pytest.raises(DecodeError):
            cdr.decode(data[:end], type(message))


def test_ignores_padding_at_the_end() -> None:
    message = String("abc")
    assert cdr.decode(cdr.encode(message) + bytes(3), String) == message


def test_refuses_a_count_beyond_the_message() -> None:
    with pytest.raises(DecodeError, match="exceeds the message"):
        cdr.decode(cdr.encode(HEADER) + b"\0" * 3 + b"\xff" * 8, JointTrajectory)


def test_refuses_another_encapsulation() -> None:
    with pytest.raises(DecodeError, match="0000 is not CDR_LE"):
        cdr.decode(b"\x00\x00\x00\x00\x00", String)


@given(st.binary(max_size=200), st.sampled_from([JointTrajectory, DiagnosticArray, Imu]))
def test_decodes_or_refuses_any_bytes(data: bytes, message: type[Struct]) -> None:
    with contextlib.suppress(DecodeError):
        cdr.encode(cdr.decode(cdr.HEADER + data, message))


def test_message_type_refuses_another_class() -> None:
    with pytest.raises(TypeError, match="not a message"):
        message_type(Header)
