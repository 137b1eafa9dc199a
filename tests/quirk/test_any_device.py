"""Random CoE servers and random SIIs.

The other devices are always found, every error names its device, and the time is bounded.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from random import Random

from hypothesis import example, given, settings
from hypothesis import strategies as st

import catenary as cat
from catenary.errors import CatenaryError
from catenary.plan import DeviceRequest, ObjectReference
from catenary.types import UDINT
from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo
from catenary.virtual.devices.application import Application
from catenary.virtual.sii_image import checksum
from catenary.wire.al import AlState
from tests.plan.devices import Asking

STRANGE, SOUND = 2, 3  # positions
SCAN_MAX, LIST_MAX, PLAN_MAX = 65.0, 120.0, 70.0  # [s] of virtual time
COE = 3
SDO_REQUEST, SDO_RESPONSE, SDO_INFORMATION = 2, 3, 8

Answers = list[tuple[int, bytes]]  # mailbox protocol and data
Misdeed = Callable[[Random, bytes, Answers], Answers]


def right(_random: Random, _request: bytes, answers: Answers) -> Answers:
    return answers


def nothing(_random: Random, _request: bytes, _answers: Answers) -> Answers:
    return []


def noise(random: Random, _request: bytes, answers: Answers) -> Answers:
    return [(random.randrange(16), random.randbytes(random.randrange(100))) for _ in answers]


def coe_noise(random: Random, _request: bytes, _answers: Answers) -> Answers:
    service = random.choice((SDO_REQUEST, SDO_RESPONSE, SDO_INFORMATION, random.randrange(16)))
    return [(COE, struct.pack("<H", service << 12) + random.randbytes(random.randrange(100)))]


def bits_flipped(random: Random, _request: bytes, answers: Answers) -> Answers:
    return [(protocol, flipped(random, data)) for protocol, data in answers]


def cut_short(random: Random, _request: bytes, answers: Answers) -> Answers:
    return [(protocol, data[: random.randrange(len(data) + 1)]) for protocol, data in answers]


def several(random: Random, _request: bytes, answers: Answers) -> Answers:
    return answers * random.randrange(2, 6)


def mailbox_error(random: Random, _request: bytes, _answers: Answers) -> Answers:
    return [(0, random.randbytes(random.randrange(6)))]


def abort(random: Random, request: bytes, _answers: Answers) -> Answers:
    code = random.choice((0x0602_0000, 0x0609_0011, 0x0800_0022, random.randrange(1 << 32)))
    return [
        (
            COE,
            struct.pack("<H", SDO_REQUEST << 12)
            + b"\x80"
            + request[9:12]
            + struct.pack("<I", code),
        )
    ]


def drip(random: Random, request: bytes, _answers: Answers) -> Answers:
    """Announce a size and send single bytes, except the last one."""
    command = request[8]
    if command >> 5 == 3:
        return [(COE, struct.pack("<HB", SDO_RESPONSE << 12, command & 0x10 | 6 << 1) + bytes(7))]
    size = random.choice((5, 100, 4096, 1 << 20, 0xFFFF_FFFF))
    return [
        (
            COE,
            struct.pack("<HB", SDO_RESPONSE << 12, 0x41) + request[9:12] + struct.pack("<I", size),
        )
    ]


def endless_list(_random: Random, _request: bytes, _answers: Answers) -> Answers:
    part = struct.pack("<HBxH", SDO_INFORMATION << 12, 0x82, 9)
    return [(COE, part + b"\x01\x00" + bytes(range(80)))] * 16


MISDEEDS: tuple[Misdeed, ...] = (
    *(right, nothing, noise, coe_noise, bits_flipped, cut_short, several),
    *(mailbox_error, abort, drip, endless_list),
)


def flipped(random: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(random.randrange(1, 4)):
        if changed:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


class StrangeServo(Servo):
    """Servo that misbehaves in a random way for every request."""

    def __init__(self, misdeeds: list[Misdeed], seed: int) -> None:
        super().__init__(serial=1, sii_quirks=cat.virtual.SiiQuirks(pdos="absent"))
        self._misdeeds = misdeeds
        self._random = Random(seed)

    def add_objects(self, application: Application) -> None:
        super().add_objects(application)
        proper = application.mailbox._answers

        def answers(request: bytes) -> Iterable[tuple[int, bytes]]:
            misdeed = self._random.choice(self._misdeeds)
            return misdeed(self._random, request.ljust(16, b"\0"), list(proper(request)))

        application.mailbox._answers = answers  # type: ignore[method-assign]


class StrangeEeprom(Servo):
    """Servo with a different EEPROM content. It accepts any configuration."""

    def __init__(self, change: Callable[[bytes], bytes]) -> None:
        super().__init__(serial=1)
        self._change = change

    def add_objects(self, application: Application) -> None:
        super().add_objects(application)
        application.check_state = lambda state: 0  # type: ignore[method-assign]

    def sii_image(self) -> bytes:
        return self._change(super().sii_image())


def segment_with(device: Servo) -> Segment:
    return Segment([Coupler(), DigitalOutputs(), device, Servo(serial=2)])


def assert_others_are_found(segment: Segment) -> None:
    """Check that the other devices answer in PRE-OP, and that the error names the strange one."""
    with cat.MainDevice(segment) as main:
        before = segment.now_ns
        subs = main.scan(strict=False)
        assert segment.now_ns - before < SCAN_MAX * 1e9
        assert [sub.position for sub in subs] == [0, 1, 2, 3]
        others = [sub for sub in subs if sub.position != STRANGE]
        assert [sub.error for sub in others] == [None] * 3
        assert [sub.state for sub in others] == [AlState.PRE_OP] * 3
        assert subs[SOUND].sdo.read(0x1018, 4, type=UDINT) == 2
        assert_named(subs[STRANGE].error)
        if subs[STRANGE].error is None:
            assert_listed(main, subs[STRANGE])
            assert_planned(main, SOUND)
            assert_planned(main, STRANGE)


def assert_planned(main: cat.MainDevice, position: int) -> None:
    """Check that a plan is made in bounded time, or that the error names the strange device."""
    request = DeviceRequest(
        inputs=(ObjectReference(0x6041, 0, 16), ObjectReference(0x60F4, 0, 32, required=False)),
        start_up=((0x6060, 0, b"\x08"),),
    )
    before = main.link.now()
    try:
        main.plan(Asking({position: request}))
    except CatenaryError as error:
        assert_named(error)
    assert main.link.now() - before < PLAN_MAX * 1e9


def assert_listed(main: cat.MainDevice, sub: cat.SubDevice) -> None:
    """Check that the dictionary is listed in bounded time, or that the error names the device."""
    before = main.link.now()
    try:
        sub.sdo.list()
    except CatenaryError as error:  # success is possible, too
        assert_named(error)
    assert main.link.now() - before < LIST_MAX * 1e9


def assert_named(error: Exception | None) -> None:
    assert error is None or str(error).startswith(f"device {STRANGE}"), error
    assert "cannot use the data of the device" not in str(error), (
        error
    )  # not an error of the decoder


@settings(max_examples=100)
@given(
    misdeeds=st.lists(st.sampled_from(MISDEEDS), min_size=1, max_size=5),
    seed=st.integers(0, 2**32 - 1),
)
def test_random_coe_servers(misdeeds: list[Misdeed], seed: int) -> None:
    assert_others_are_found(segment_with(StrangeServo(misdeeds, seed)))


def with_checksum(image: bytes) -> bytes:
    """Return the image with a valid checksum, without which a controller loads no configuration."""
    return image[:14] + bytes([checksum(image[:14])]) + image[15:]


@settings(max_examples=100)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 40), valid=st.booleans())
def test_siis_with_random_bytes_changed(seed: int, count: int, valid: bool) -> None:
    random = Random(seed)

    def change(image: bytes) -> bytes:
        changed = bytearray(image)
        for _ in range(count):
            changed[random.randrange(700)] = random.randrange(256)
        return with_checksum(bytes(changed)) if valid else bytes(changed)

    assert_others_are_found(segment_with(StrangeEeprom(change)))


@settings(max_examples=50)
@given(st.binary(max_size=2048), st.sampled_from((b"\x00", b"\xff", b"\x0a")))
@example(b"", b"\xff")
def test_siis_of_any_bytes(content: bytes, rest: bytes) -> None:
    def change(image: bytes) -> bytes:
        return with_checksum(content.ljust(2048, rest))

    assert_others_are_found(segment_with(StrangeEeprom(change)))


@settings(max_examples=100)
@given(
    offsets=st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF)),
    sizes=st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF)),
    protocols=st.integers(0, 0xFFFF),
)
@example(offsets=(0x1000, 0x1080), sizes=(65535, 65535), protocols=4)
@example(offsets=(0x1000, 0x1080), sizes=(8, 8), protocols=4)
@example(offsets=(0x1000, 0x1080), sizes=(128, 8), protocols=4)
@example(offsets=(0x0800, 0x0808), sizes=(128, 128), protocols=4)
def test_siis_with_any_mailbox(
    offsets: tuple[int, int], sizes: tuple[int, int], protocols: int
) -> None:
    def change(image: bytes) -> bytes:
        areas = struct.pack("<5H", offsets[0], sizes[0], offsets[1], sizes[1], protocols)
        return image[:48] + areas + image[58:]

    assert_others_are_found(segment_with(StrangeEeprom(change)))
