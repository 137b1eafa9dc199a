"""Slow, unusual or duplicate answers: the device reaches PRE-OP, or the error names it."""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable, Iterator

import pytest

import catenary as cat
from catenary.errors import CatenaryError, EepromError, MappingError, ResponseTimeout
from catenary.link import Fault, FaultInjector
from catenary.types import UDINT
from catenary.virtual.devices import device as virtual_device
from catenary.virtual.sii_image import (
    FMMU,
    GENERAL,
    HEADER_BYTES,
    RX_PDO,
    STRINGS,
    SYNC_MANAGER,
    TX_PDO,
)
from catenary.wire.al import AlState

MS = 1_000_000
MAILBOX_WRITTEN = 2  # event of the controller


def segment() -> cat.Segment:
    return cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.DigitalOutputs()])


# ---- EEPROM


def test_the_scan_waits_for_a_slow_eeprom() -> None:
    slow = segment()
    slow.core.time_sii(1, 20 * MS, 20 * MS, False)
    with cat.MainDevice(slow) as main:
        assert main.scan()[1].is_drive
        assert slow.now_ns > 1_000 * MS  # some hundred words, 20 ms each


def test_a_device_with_a_busy_eeprom_is_named() -> None:
    slow = segment()
    slow.core.time_sii(1, 5_000 * MS, 5_000 * MS, False)
    with cat.MainDevice(slow) as main:
        with pytest.raises(EepromError, match=r"device 1.*busy") as caught:
            main.scan()
        assert caught.value.hint
        assert main.subs[2].state == AlState.PRE_OP


# ---- mailbox


def answering_late(device: cat.virtual.Servo, segment: cat.Segment, delay_ns: int) -> None:
    handle = device.handle

    def later(events: int) -> None:
        segment.service.agenda.after(delay_ns, lambda: handle(events))

    device.handle = later  # type: ignore[method-assign]


def test_a_reply_after_half_a_second_is_accepted() -> None:
    late = segment()
    with cat.MainDevice(late) as main:
        servo = main.scan()[1]
        answering_late(late[1], late, 500 * MS)
        before = late.now_ns
        assert servo.sdo.read(0x1018, 1, type=UDINT) == servo.identity.vendor
        assert late.now_ns - before > 500 * MS


def test_a_missing_reply_has_a_deadline_and_the_mailbox_recovers() -> None:
    late = segment()
    with cat.MainDevice(late) as main:
        servo = main.scan()[1]
        answer = late[1].handle
        late[1].handle = lambda events: None  # type: ignore[method-assign]
        before = late.now_ns
        with pytest.raises(ResponseTimeout, match="device 1"):
            servo.sdo.read(0x1018, 1)
        assert late.now_ns - before < 10_000 * MS
        late[1].handle = answer  # type: ignore[method-assign]
        answer(MAILBOX_WRITTEN)
        assert servo.sdo.read(0x1018, 2, type=UDINT) == servo.identity.product


# ---- SII


def categories(image: bytes) -> Iterator[tuple[int, bytes]]:
    at = HEADER_BYTES
    while True:
        kind, words = struct.unpack_from("<HH", image, at)
        if kind == 0xFFFF:
            return
        yield kind, image[at : at + 4 + 2 * words]
        at += 4 + 2 * words


def changed(monkeypatch: pytest.MonkeyPatch, change: Callable[[bytes], bytes]) -> cat.Segment:
    """Return a segment whose servo has another SII image."""
    make = virtual_device.make_sii_image

    def made(description: object, *quirks: object) -> bytes:
        image = make(description, *quirks)
        return change(image) if description.axes else image

    monkeypatch.setattr(virtual_device, "make_sii_image", made)
    return segment()


@pytest.mark.parametrize("missing", [STRINGS, GENERAL, FMMU, SYNC_MANAGER, TX_PDO, RX_PDO])
def test_an_sii_without_one_of_its_categories(
    monkeypatch: pytest.MonkeyPatch, missing: int
) -> None:
    """It reaches PRE-OP and answers. Without SyncManagers, it cannot exchange process data."""

    def without(image: bytes) -> bytes:
        rest = b"".join(part for kind, part in categories(image) if kind != missing)
        return (image[:HEADER_BYTES] + rest + b"\xff\xff\xff\xff").ljust(len(image), b"\xff")

    with cat.MainDevice(changed(monkeypatch, without)) as main:
        servo = main.scan()[1]
        assert main.subs[2].state == AlState.PRE_OP
        assert servo.state == AlState.PRE_OP
        assert servo.name
        assert servo.sdo.read(0x1018, 1, type=UDINT) == servo.identity.vendor
        arm = cat.Drives([servo], counts_per_turn=2**20, velocity_limit=100.0)
        if missing == SYNC_MANAGER:  # process data cannot be mapped
            with pytest.raises(MappingError, match=r"device 1.*SyncManager"), cat.Loop(arm):
                pass
            return
        with cat.Loop(arm) as loop:
            assert next(loop).ok


def test_an_sii_with_coe_but_without_a_mailbox(monkeypatch: pytest.MonkeyPatch) -> None:
    """The header has a standard mailbox of size 0."""

    def without_mailbox(image: bytes) -> bytes:
        return image[:48] + b"\0" * 8 + image[56:]

    with cat.MainDevice(changed(monkeypatch, without_mailbox)) as main:
        servo = main.scan(strict=False)[1]
        with pytest.raises(CatenaryError, match="device 1"):
            servo.sdo.read(0x1018, 1)


# ---- frames


def test_duplicate_answers_are_ignored() -> None:
    link = FaultInjector(segment(), seed=1)
    link.inject(Fault(kind="duplicate"))
    with cat.MainDevice(link) as main:
        subs = main.scan()
        assert [sub.state for sub in subs] == [AlState.PRE_OP] * 3
        assert subs[1].sdo.read(0x1018, 1, type=UDINT) == subs[1].identity.vendor
        arm = cat.Drives(subs.drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm) as loop:
            for cycle in loop:
                assert cycle.ok
                if cycle.number == 50:
                    break
            assert loop.timing.counters["duplicate"] > 40


# ---- while a loop runs


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_sdo_works_in_another_thread_but_not_in_the_loops_thread(run: str) -> None:
    devices = [cat.virtual.Coupler(), cat.virtual.Servo()]
    found: list[int] = []
    with cat.MainDevice(cat.Segment(devices, clock="monotonic")) as main:
        servo = main.scan()[1]
        arm = cat.Drives([servo], counts_per_turn=2**20, velocity_limit=100.0)

        def ask() -> None:
            servo.sdo.write(0x6065, 0, 12345, type=UDINT)
            found.append(servo.sdo.read(0x6065, 0, type=UDINT))

        with cat.Loop(
            arm,
            period=2e-3,
            execution=run,
            stop=cat.StopPolicy(lost_limit=1000, late_limit=0),
            watchdog=5.0,
        ) as loop:
            asking = threading.Thread(target=ask)
            asking.start()
            while asking.is_alive():
                next(loop)
            asking.join()
            with pytest.raises(RuntimeError, match="another thread"):
                servo.sdo.read(0x6065, 0)
    assert found == [12345]


def test_a_port_with_a_link_but_without_a_device_is_noted() -> None:
    odd = segment()
    with cat.MainDevice(odd) as main:
        main.scan()
        assert main.notes == ()
        word = int.from_bytes(odd.core.peek(2, 0x0110, 2), "little") & ~0x0C00 | 0x0820
        odd.core.poke(2, 0x0110, word.to_bytes(2, "little"))
        main.scan()
        [note] = main.notes
    assert note.startswith("device 2 port 1 is open, but no device answers behind it")
