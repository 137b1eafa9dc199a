"""Copies: places by PDO, name, object and bytes, and the errors for impossible copies."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary import types
from catenary.bus import SubDevices
from catenary.drive.copy_place import CopyPlace
from catenary.drive.fsoe import FsoeFrames, fsoe_problems
from catenary.errors import ConfigurationError, MappingError
from catenary.loop.devices import LoopRequest
from catenary.plan import Plan
from catenary.virtual import (
    Coupler,
    DigitalInputs,
    DigitalOutputs,
    SafetyLogic,
    SafetyTerminal,
    Segment,
    Servo,
)

BUTTONS, LAMPS, LOGIC, CURTAIN, SERVO = 1, 2, 3, 4, 5


@pytest.fixture(scope="module")
def subs() -> Iterator[SubDevices]:
    devices = [Coupler(), DigitalInputs(bits=9), DigitalOutputs(bits=16), SafetyLogic(size=4)]
    with cat.MainDevice(Segment([*devices, SafetyTerminal(size=4), Servo()])) as main:
        yield main.scan()


def plan_of(subs: SubDevices, *requests: LoopRequest) -> Plan:
    main = subs[0].main
    assert isinstance(main, cat.MainDevice)
    return main.plan(*requests)


def places(subs: SubDevices, *copies: cat.Copy) -> list[tuple[int, int, int]]:
    """Return the copies as bits from the start of the source's inputs and of the outputs."""
    plan = plan_of(subs, cat.Copies(*copies))
    inputs = [plan.layout.devices[copy.source.position].input_offset * 8 for copy in copies]
    outputs = [plan.layout.devices[copy.destination.position].output_offset * 8 for copy in copies]
    return [
        (made.input_bit - source, made.output_bit - destination, made.bit_length)
        for made, source, destination in zip(plan.cycle.copies, inputs, outputs, strict=True)
    ]


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        (0x1A02, (2, 0, 1)),
        ("0x1A02", (2, 0, 1)),
        ("Channel 3", (2, 0, 1)),
        ("channel 3", (2, 0, 1)),
        ((0x6020, 1), (2, 0, 1)),
        ("0x6020:01", (2, 0, 1)),
    ],
)
def test_one_bit(subs: SubDevices, place: CopyPlace, expected: object) -> None:
    assert places(subs, cat.Copy(subs[BUTTONS], place, subs[LAMPS], "Channel 1")) == [expected]


@pytest.mark.parametrize("place", [range(1, 3), "bytes 1 to 2"])
def test_bytes(subs: SubDevices, place: CopyPlace) -> None:
    copy = cat.Copy(subs[CURTAIN], place, subs[LAMPS], range(2))
    assert places(subs, copy) == [(8, 0, 16)]


def test_the_plan_counts_bits_and_bytes(subs: SubDevices) -> None:
    plan = plan_of(
        subs,
        cat.Copies(
            cat.Copy(subs[BUTTONS], "Channel 3", subs[LAMPS], "Channel 1"),
            cat.Copy(subs[CURTAIN], range(1), subs[LAMPS], range(1, 2)),
        ),
    )
    assert "PDO 0x1600 Channel 1, 1 bit\n" in str(plan)
    assert "bytes 1 to 1, 1 byte\n" in str(plan)


@pytest.mark.parametrize(("own", "expected"), [(None, (1, 4)), (2, (2, 2)), (8, (8, 4))])
def test_a_divider_of_another_request_remains(
    subs: SubDevices, own: int | None, expected: tuple[int, int]
) -> None:
    copies = cat.Copies(cat.Copy(subs[BUTTONS], 0x1A00, subs[LAMPS], 0x1600), divider=own)
    other = cat.ProcessData(subs[LAMPS], outputs={}, divider=4)
    layout = plan_of(subs, other, copies).layout
    dividers = [layout.units[layout.sync_unit(k)].divider for k in (BUTTONS, LAMPS)]
    assert tuple(dividers) == expected


@pytest.mark.parametrize(
    ("place", "text"),
    [(0x1A00, "0x1A00"), ((0x6000, 1), "0x6000:01"), (range(7), "bytes 0 to 6"), ("FSoE", "FSoE")],
)
def test_a_connection_names_its_places(subs: SubDevices, place: CopyPlace, text: str) -> None:
    connection = cat.FsoeConnection((subs[LOGIC], place, 0x1600), (subs[CURTAIN], 0x1A00, 0x1600))
    assert f"virtual safety logic), {text} ↔ device 4" in str(connection)
    assert str(connection).endswith(", 0x1A00")


def test_an_object_by_its_name(subs: SubDevices) -> None:
    copy = cat.Copy(subs[CURTAIN], "FSoE sub frame CRC_1", subs[LAMPS], range(2))
    assert places(subs, copy) == [(56, 0, 16)]


def test_an_object_that_another_request_maps(subs: SubDevices) -> None:
    copies = cat.Copies(cat.Copy(subs[SERVO], (0x6062, 0), subs[CURTAIN], range(1, 5)))
    with pytest.raises(MappingError, match="0x6062:00: the object is not in the process data"):
        plan_of(subs, copies)
    demand = cat.Inputs(subs[SERVO], channels={"demand": (0x6062, 0, types.DINT)})
    assert len(plan_of(subs, demand, copies).cycle.copies) == 1


def test_a_relay_copies_both_ways(subs: SubDevices) -> None:
    relay = cat.Copies(
        cat.FsoeConnection((subs[LOGIC], 0x1A00, 0x1600), (subs[CURTAIN], 0x1A00, 0x1600))
    )
    plan = plan_of(subs, relay)
    assert [copy.bit_length for copy in plan.cycle.copies] == [88, 88]
    assert [copy.device for copy in plan.cycle.copies] == [CURTAIN, LOGIC]
    text = str(plan)
    assert "copies between devices\n" in text
    assert "inputs of 3 Catenary virtual safety logic, PDO 0x1A00 FSoE main frame → outputs of 4" \
        in text  # fmt: skip
    with pytest.raises(RuntimeError, match="before a Loop is open"):
        relay.fsoe_frames  # noqa: B018


def copy_error(subs: SubDevices, *copies: cat.Copy) -> str:
    with pytest.raises((ConfigurationError, MappingError)) as caught:
        plan_of(subs, cat.Copies(*copies))
    return str(caught.value)


def test_lengths_must_match(subs: SubDevices) -> None:
    text = copy_error(subs, cat.Copy(subs[CURTAIN], 0x1A00, subs[LAMPS], range(2)))
    assert "inputs of 4 Catenary virtual safety terminal, PDO 0x1A00" in text
    assert "has 88 bits, but outputs of 2 Catenary virtual 16-channel output, bytes 0 to 1" in text


def test_a_device_cannot_be_copied_to_itself(subs: SubDevices) -> None:
    text = copy_error(subs, cat.Copy(subs[CURTAIN], 0x1A00, subs[CURTAIN], 0x1600))
    assert "PDO 0x1A00 FSoE sub frame cannot be copied to outputs of 4" in text
    assert "PDO 0x1600 FSoE main frame: this is the same device" in text


def test_destinations_must_not_overlap(subs: SubDevices) -> None:
    whole = cat.Copy(subs[CURTAIN], range(2), subs[LAMPS], range(2))
    bit = cat.Copy(subs[BUTTONS], "Channel 4", subs[LAMPS], "Channel 9")
    text = copy_error(subs, whole, bit)
    assert "two copies write the same outputs" in text
    assert "bytes 0 to 1 → outputs of 2" in text
    assert "PDO 0x1A03 Channel 4 → outputs of 2" in text


def test_bits_of_one_byte_may_come_from_several_copies(subs: SubDevices) -> None:
    copies = [
        cat.Copy(subs[BUTTONS], f"Channel {k}", subs[LAMPS], f"Channel {9 - k}") for k in (1, 2)
    ]
    assert places(subs, *copies) == [(0, 7, 1), (1, 6, 1)]


def test_bytes_beyond_the_device(subs: SubDevices) -> None:
    text = copy_error(subs, cat.Copy(subs[CURTAIN], range(10, 12), subs[LAMPS], range(2)))
    assert "bytes 10 to 11: the device has 11 bytes of inputs" in text


def test_two_requests_cannot_write_one_byte(subs: SubDevices) -> None:
    copies = [
        cat.Copies(cat.Copy(subs[BUTTONS], "Channel 1", subs[LAMPS], f"Channel {k}"))
        for k in (1, 2)
    ]
    with pytest.raises(ConfigurationError, match="two requests write byte 0 of its outputs"):
        plan_of(subs, *copies)


@pytest.mark.parametrize(
    ("place", "error", "message"),
    [
        ("Chanel 3", MappingError, "no object of its inputs has the name 'Chanel 3'"),
        ("Input", MappingError, "9 places of its inputs have the name 'Input'"),
        (0x1B00, MappingError, "no PDO 0x1B00 for inputs"),
        ("0x1600", MappingError, "no PDO 0x1600 for inputs"),
        (range(0), ValueError, "at least one byte, in order"),
        (range(4, 0, -1), ValueError, "at least one byte, in order"),
        (1.5, TypeError, "1.5 is not a place of a copy"),
        (True, TypeError, "True is not a place of a copy"),
        ((1, 2, 3), TypeError, "is not a place of a copy"),
    ],
)
def test_places_that_do_not_exist(
    subs: SubDevices, place: object, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        cat.Copies(cat.Copy(subs[BUTTONS], place, subs[LAMPS], 0x1600))  # type: ignore[arg-type]


def test_a_frame_of_fsoe_must_have_its_size(subs: SubDevices) -> None:
    relay = cat.Copies(
        cat.FsoeConnection((subs[LOGIC], range(8), range(8)), (subs[CURTAIN], range(8), range(8)))
    )
    with pytest.raises(ConfigurationError, match=r"\(64 bits, .*is not an FSoE frame"):
        plan_of(subs, relay)


def test_wrong_arguments(subs: SubDevices) -> None:
    with pytest.raises(ValueError, match="at least one Copy"):
        cat.Copies()
    with pytest.raises(ValueError, match="optional: no copy uses device 3"):
        cat.Copies(cat.Copy(subs[BUTTONS], 0x1A00, subs[LAMPS], 0x1600), optional=[subs[LOGIC]])
    with pytest.raises(TypeError, match="takes Copy and FsoeConnection objects"):
        cat.Copies(subs[1])  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="a copy needs SubDevices"):
        cat.Copies(cat.Copy("logic", 0x1A00, subs[LAMPS], 0x1600))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="give \\(device, place in its inputs"):
        cat.FsoeConnection((subs[LOGIC], 0x1A00), (subs[CURTAIN], 0, 0))  # type: ignore[arg-type]


def test_copies_between_networks_are_refused(subs: SubDevices) -> None:
    with cat.MainDevice(Segment([Coupler(), DigitalOutputs()])) as other:
        lamps = other.scan()[1]
        with pytest.raises(ValueError, match="they belong to different networks"):
            cat.Copies(cat.Copy(subs[BUTTONS], 0x1A00, lamps, 0x1600))


def frames(name: str, main: int, sub: int) -> FsoeFrames:
    first, second = (bytes((0x36, 0, 0, 0, number, 0)) for number in (main, sub))
    return FsoeFrames(name, first, second)


def test_contradictions_between_connection_ids() -> None:
    assert fsoe_problems([frames("a", 1, 1), frames("b", 2, 0), frames("c", 0, 0)]) == ()
    [text] = fsoe_problems([frames("a", 1, 2)])
    assert text.startswith("a: main uses connection ID 1, but sub uses 2")
    [text] = fsoe_problems([frames("a", 1, 1), frames("b", 0, 1)])
    assert text == "connection ID 1 is used by a and b"
    assert str(frames("a", 1, 0)) == (
        "a: main PROCESS_DATA, connection ID 1; sub PROCESS_DATA, connection ID 0"
    )
