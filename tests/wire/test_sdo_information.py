"""SDO information."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire import sdo_information
from catenary.wire.sdo_information import (
    Access,
    EntryDescription,
    ListType,
    ObjectDescription,
    ObjectList,
    Opcode,
    SdoInformation,
    ValueInfo,
    decode_entry_description,
    decode_error,
    decode_object_description,
    decode_object_list,
    decode_sdo_information,
)
from tests.wire.strategies import flag, u8, u16

latin = st.text(st.characters(codec="latin-1"), max_size=20)
messages = st.builds(SdoInformation, *(st.sampled_from(Opcode), st.binary(max_size=40), u16, flag))
lists = st.builds(ObjectList, st.sampled_from(ListType), st.lists(u16, max_size=20).map(tuple))
objects = st.builds(ObjectDescription, *(u16, u16, u8, u8, latin))
entries = st.builds(
    EntryDescription,
    *(u16, u8, u8.map(ValueInfo), u16, u16, u16.map(Access), st.binary(max_size=30)),
)


# From the tables of ETG.1000.6 §5.6.3
def test_requests():
    assert sdo_information.list_request(ListType.ALL).encode().hex() == "0080010000000100"
    assert sdo_information.object_request(0x1018).encode().hex() == "0080030000001810"
    asked = sdo_information.entry_request(0x1018, 1, ValueInfo.UNIT)
    assert asked.encode().hex() == "00800500000018100108"


def test_a_fragment_of_a_list():
    message = decode_sdo_information(bytes.fromhex("0080820002000100001008101810"))
    assert message.opcode == Opcode.LIST_RESPONSE
    assert (message.incomplete, message.fragments_left) == (True, 2)
    assert decode_object_list(message.data).indices == (0x1000, 0x1008, 0x1018)


def test_an_object():
    data = bytes.fromhex("181023000409") + b"Identity"
    assert decode_object_description(data) == ObjectDescription(0x1018, 0x23, 4, 9, "Identity")


def test_an_entry():
    data = bytes.fromhex("18100100070020000700") + b"Vendor ID"
    entry = decode_entry_description(data)
    assert (entry.index, entry.subindex, entry.data_type, entry.bit_length) == (0x1018, 1, 7, 32)
    assert entry.access == Access.READ_PRE_OP | Access.READ_SAFE_OP | Access.READ_OP
    assert entry.name == "Vendor ID"


def test_the_name_of_an_entry_follows_the_selected_fields():
    info = ValueInfo.UNIT | ValueInfo.DEFAULT | ValueInfo.MAXIMUM
    rest = bytes(4) + b"\x05\x00" + b"\xff\xff" + b"Speed"
    entry = EntryDescription(0x2000, 1, info, 6, 16, Access.READ_OP, rest)
    assert entry.name == "Speed"


@given(messages)
def test_a_message_round_trips(message):
    assert decode_sdo_information(message.encode()) == message


@given(lists)
def test_a_list_round_trips(value):
    assert decode_object_list(value.encode()) == value


@given(objects)
def test_an_object_round_trips(value):
    assert decode_object_description(value.encode()) == value


@given(entries)
def test_an_entry_round_trips(value):
    assert decode_entry_description(value.encode()) == value


@given(st.binary(max_size=60))
@pytest.mark.parametrize(
    "decode",
    [
        decode_sdo_information,
        decode_object_list,
        decode_object_description,
        decode_entry_description,
    ],
)
def test_any_bytes_give_a_value_or_decode_error(decode, data):
    try:
        value = decode(data)
    except DecodeError:
        return
    assert decode(value.encode()) == value


def test_errors_name_the_reason():
    with pytest.raises(DecodeError, match="unknown opcode 9"):
        decode_sdo_information(bytes.fromhex("008009000000"))
    with pytest.raises(DecodeError, match="CoE service 2"):
        decode_sdo_information(bytes.fromhex("002001000000"))
    with pytest.raises(DecodeError, match="needs at least 2"):
        decode_object_list(b"\x01")
    with pytest.raises(DecodeError, match="unknown kind 6"):
        decode_object_list(b"\x06\x00")


def test_an_incomplete_abort_code_gives_none():
    assert decode_error(bytes.fromhex("00000206")) == 0x06020000
    assert decode_error(bytes(3)) is None
    assert decode_error(b"") is None


def test_an_incomplete_index_at_the_end_is_ignored():
    assert decode_object_list(b"\x01\x00\x00\x10\x08").indices == (0x1000,)
