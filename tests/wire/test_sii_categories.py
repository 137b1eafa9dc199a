"""Contents of SII categories."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.sii_categories import (
    ClockMode,
    CoeDetails,
    General,
    Pdo,
    PdoEntry,
    SyncManagerEnable,
    SyncManagerEntry,
    SyncManagerUse,
    decode_clock_modes,
    decode_general,
    decode_pdos,
    decode_strings,
    decode_sync_managers,
    encode_clock_modes,
    encode_fmmus,
    encode_pdos,
    encode_strings,
    encode_sync_managers,
)
from tests.wire.strategies import i32, u8, u16, u32

i16 = st.integers(-(1 << 15), (1 << 15) - 1)
generals = st.builds(
    General,
    *(u8, u8, u8, u8, u8.map(CoeDetails), u8, u8, u8, u8, u8, u8, i16, u16, u16),
    st.binary(min_size=15, max_size=15),
)
texts = st.lists(st.text(st.characters(codec="latin-1"), max_size=30), max_size=20)
sync_managers = st.lists(
    st.builds(SyncManagerEntry, *(u16, u16, u8, u8, u8.map(SyncManagerEnable), u8)), max_size=8
)
entries = st.lists(st.builds(PdoEntry, *(u16, u8, u8, u8, u8, u16)), max_size=10).map(tuple)
pdos = st.lists(st.builds(Pdo, *(u16, entries, u8, u8, u8, u16)), max_size=6)
clock_modes = st.lists(
    st.builds(
        ClockMode,
        *(u32, i32, i32, i16, u16, i16, u8, u8, st.binary(min_size=4, max_size=4)),
    ),
    max_size=4,
)


def test_general_of_an_el2004():
    # ethercrab's dumps/el2004-eeprom-dump.bin
    data = bytes.fromhex("020001040c000000000000006400030033000000000000000000000000000000")
    general = decode_general(data)
    assert (general.group, general.order, general.name) == (2, 1, 4)
    assert general.current_ma == 100
    assert general.physical_ports == 0x0033
    assert not general.coe
    assert general.encode() == data


def test_a_coupler_has_a_negative_current():
    # ethercrab's dumps/ek1100-eeprom-dump.bin
    data = bytes.fromhex("02000104020000000000000030f8030031010000000000000000000000000000")
    assert decode_general(data).current_ma == -2000


def test_pdos_of_an_el2004():
    # ethercrab's dumps/el2004-eeprom-dump.bin: the first two of four
    data = bytes.fromhex("0016010000051100007001060101000001160100000711001070010601010000")
    first, second = decode_pdos(data)
    assert first == Pdo(
        0x1600, (PdoEntry(0x7000, 1, 1, data_type=1, name=6),), 0, 0, name=5, flags=0x11
    )
    assert (second.index, second.bit_length) == (0x1601, 1)


def test_sync_managers_of_a_drive():
    # MetalMusings EaserCAT 2000, the first two
    data = bytes.fromhex("00100002260001010012000222000102")
    mailbox_out, mailbox_in = decode_sync_managers(data)
    assert mailbox_out.use == SyncManagerUse.MAILBOX_OUT
    assert (mailbox_in.address, mailbox_in.length, mailbox_in.control) == (0x1200, 512, 0x22)


@given(generals)
def test_general_round_trips(general):
    assert decode_general(general.encode()) == general


@given(texts)
def test_strings_round_trip(strings):
    encoded = encode_strings(strings)
    assert len(encoded) % 2 == 0
    assert decode_strings(encoded) == tuple(strings)


@given(sync_managers)
def test_sync_managers_round_trip(values):
    assert decode_sync_managers(encode_sync_managers(values)) == tuple(values)


@given(pdos)
def test_pdos_round_trip(values):
    assert decode_pdos(encode_pdos(values)) == tuple(values)


@given(clock_modes)
def test_clock_modes_round_trip(values):
    assert decode_clock_modes(encode_clock_modes(values)) == tuple(values)


@given(st.binary(max_size=300))
@pytest.mark.parametrize(
    "decode",
    [decode_strings, decode_general, decode_pdos, decode_sync_managers, decode_clock_modes],
)
def test_any_bytes_give_a_value_or_decode_error(decode, data):
    try:
        value = decode(data)
    except DecodeError as error:
        value = error
    assert value is not None


def test_padding_at_the_end_is_ignored():
    entry = SyncManagerEntry(0x1000, 128, 0x26)
    assert decode_sync_managers(entry.encode() + b"\xff\xff") == (entry,)
    assert decode_pdos(Pdo(0x1A00).encode() + b"\x00\x00") == (Pdo(0x1A00),)


def test_fmmus_are_padded():
    assert encode_fmmus((1, 2, 3)) == b"\x01\x02\x03\xff"
    assert encode_fmmus((1, 2)) == b"\x01\x02"


@pytest.mark.parametrize(
    "value",
    [
        SyncManagerEntry(0x10000, 0, 0),
        Pdo(0x10000),
        Pdo(0, (PdoEntry(0, 256, 0),)),
        Pdo(0, (PdoEntry(0, 0, 1),) * 256),
        ClockMode(cycle_time_ns=-1),
    ],
)
def test_values_that_do_not_fit_are_refused(value):
    with pytest.raises(ValueError, match="SII"):
        value.encode()
