"""Devices that do not answer while their mappings are read. A scan and a plan still end."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.bus import MainDevice
from catenary.errors import ResponseTimeout
from catenary.plan import DeviceRequest, ObjectReference
from catenary.virtual import Coupler, Segment, Servo
from tests.plan.devices import Asking

POSITION = ObjectReference(0x6064, 0, 32)
OPTIONAL = ObjectReference(0x60F4, 0, 32, required=False)  # in 0x1A02, which is not assigned
SDO_REQUEST, UPLOAD, SEGMENT = 2, 2, 3
SDO_INFORMATION, GET_ENTRY = 8, 5


def make_segment(odd: Servo) -> Segment:
    return Segment([Coupler(), odd, Servo(serial=2)])


def answer_uploads(servo: Servo, answer: Callable[[bytes], list[bytes] | None]) -> None:
    """Let `answer` reply to uploads and their segments; None: the servo itself replies."""
    mailbox = servo.application.mailbox
    serve = mailbox._serve

    def replace(protocol: int, payload: bytes) -> Iterable[bytes] | int:
        is_upload = payload[1] >> 4 == SDO_REQUEST and payload[2] >> 5 in (UPLOAD, SEGMENT)
        own = answer(payload) if is_upload else None
        return serve(protocol, payload) if own is None else own

    mailbox._serve = replace


def silence(servo: Servo, *indices: int) -> None:
    """Return a filter that never answers uploads of these objects."""

    def answer(payload: bytes) -> list[bytes] | None:
        return [] if struct.unpack_from("<H", payload, 3)[0] in indices else None

    answer_uploads(servo, answer)


def drip_lists(payload: bytes) -> list[bytes] | None:
    """Announce 4000 bytes for 0x1C12, and send one byte per segment."""
    if payload[2] >> 5 == UPLOAD and payload[3:5] != b"\x12\x1c":
        return None
    if payload[2] >> 5 == SEGMENT:
        return [struct.pack("<HB7x", 0x3000, payload[2] & 0x10 | 6 << 1)]
    return [struct.pack("<HB", 0x3000, 0x41) + payload[3:6] + struct.pack("<I", 4000)]


def asking(position: int, *inputs: ObjectReference, **more: object) -> Asking:
    return Asking({position: DeviceRequest(inputs=inputs, **more)})  # type: ignore[arg-type]


def test_a_missing_list_of_pdos_does_not_end_a_scan() -> None:
    odd = Servo()
    segment = make_segment(odd)
    silence(odd, 0x1C12)
    with MainDevice(segment) as main:
        subs = main.scan()
        assert [sub.error for sub in subs] == [None] * 3
        assert subs[1].description.mapping_source == "SII"
        [note] = main.notes
        assert "device 1" in note
        assert "its mapping cannot be read, so that of its SII is used" in note


def test_a_missing_list_of_pdos_does_not_affect_other_devices() -> None:
    odd = Servo()
    segment = make_segment(odd)
    silence(odd, 0x1C12)
    with MainDevice(segment) as main:
        main.scan()
        arm = cat.Drives([main.subs[2]], counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm) as loop:
            next(loop)
            assert {device.state for device in segment} == {8}
        with pytest.raises(ResponseTimeout, match="device 1"):
            main.plan(asking(1, POSITION))


def test_an_endless_list_of_pdos_does_not_block_a_scan() -> None:
    odd = Servo(mailbox_delay=0.05)
    segment = make_segment(odd)
    answer_uploads(odd, drip_lists)
    with MainDevice(segment) as main:
        main.scan()
        assert segment.now_ns < 20e9
        assert "of 4000 bytes within 5 s" in str(main.notes)


def test_a_slow_mailbox_does_not_block_a_scan() -> None:
    segment = make_segment(Servo(mailbox_delay=1.5))
    with MainDevice(segment) as main:
        main.scan()
        assert segment.now_ns < 40e9
        assert "was not complete within 15 s" in str(main.notes)


@contextmanager
def slow_mailbox() -> Iterator[MainDevice]:
    """Yield a scanned MainDevice; device 1 needs 1.6 s for each answer.

    The block must take less than 70 s of virtual time.
    """
    odd = Servo()
    segment = make_segment(odd)
    with MainDevice(segment) as main:
        main.scan()
        odd.application.mailbox.delay(1_600_000_000)
        before = segment.now_ns
        yield main
        assert segment.now_ns - before < 70e9


def test_a_slow_mailbox_does_not_block_a_plan() -> None:
    start_up = tuple((0x2200 + k, 0, b"\x00") for k in range(40))
    too_slow = pytest.raises(ResponseTimeout, match=r"device 1 .* not complete within 60 s")
    with slow_mailbox() as main, too_slow:
        main.plan(asking(1, OPTIONAL, start_up=start_up))


def test_a_slow_mailbox_does_not_block_the_reading_of_settings() -> None:
    too_slow = pytest.raises(ResponseTimeout, match="its settings were not complete within 60 s")
    with slow_mailbox() as main, too_slow:
        main.read_objects({1: [(0x1018, k % 4 + 1) for k in range(100)]})


@pytest.mark.parametrize("length", [None, 0, 6])
def test_pdos_without_a_description_do_not_end_a_plan(length: int | None) -> None:
    """Descriptions of entries are missing or truncated."""
    odd = Servo()
    with MainDevice(make_segment(odd)) as main:
        main.scan()
        mailbox = odd.application.mailbox
        serve = mailbox._serve

        def describe(protocol: int, payload: bytes) -> Iterable[bytes] | int:
            if payload[1] >> 4 != SDO_INFORMATION or payload[2] & 0x7F != GET_ENTRY:
                return serve(protocol, payload)
            if length is None:
                return []
            answer = struct.pack("<HBBH", SDO_INFORMATION << 12, GET_ENTRY + 1, 0, 0)
            return [answer + (payload[6:9] + bytes(3))[:length]]

        mailbox._serve = describe
        main.configure(main.plan(asking(1, POSITION, OPTIONAL)))


@pytest.mark.parametrize("indices", [(0x1A02,), (0x60F4,)])
def test_missing_optional_objects_do_not_end_a_plan(indices: tuple[int, ...]) -> None:
    odd = Servo()
    with MainDevice(make_segment(odd)) as main:
        main.scan()
        silence(odd, *indices)
        main.configure(main.plan(asking(1, POSITION, OPTIONAL)))


def test_a_missing_value_is_shown_as_not_read() -> None:
    odd = Servo()
    with MainDevice(make_segment(odd)) as main:
        main.scan()
        silence(odd, 0x6060)
        plan = main.plan(asking(1, POSITION, start_up=((0x6060, 0, b"\x08"),)))
        assert "0x6060:00  (not read) → 08" in str(plan)
        main.configure(plan)


def test_an_unusual_refusal_of_a_synchronisation_type_does_not_end_a_bring_up() -> None:
    """0x08000000, a general error, instead of the code for an object that does not exist."""
    odd = Servo()
    segment = make_segment(odd)

    def refuse(payload: bytes) -> list[bytes] | None:
        if payload[3:5] not in (b"\x32\x1c", b"\x33\x1c"):
            return None
        return [struct.pack("<HB", 0x2000, 0x80) + payload[3:6] + struct.pack("<I", 0x0800_0000)]

    answer_uploads(odd, refuse)
    with MainDevice(segment) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=100.0, dc=True)
        with cat.Loop(arm) as loop:
            next(loop)
            assert {device.state for device in segment} == {8}
