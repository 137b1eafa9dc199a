"""Scan, bring-up, motion, objects and clocks with every quirk of the table."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import CatenaryError
from catenary.link import Fault, FaultInjector
from catenary.types import UDINT, UINT
from catenary.virtual import Segment, Servo
from catenary.wire.al import AlState
from tests.quirk.table import QUIRKS, QUIRKY, SOUND, Quirk
from tests.scenario.clocked import run_for, true_differences

OP = 8
LARGE, SCRATCH, SERIAL = 0x2100, 0x2102, (0x1018, 4)
WORKING = {name: quirk for name, quirk in QUIRKS.items() if not quirk.broken}
BROKEN = {name: quirk for name, quirk in QUIRKS.items() if quirk.broken}


def each(quirks: dict[str, Quirk]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("quirk", quirks.values(), ids=quirks.keys())


def drives(main: cat.MainDevice, **options: object) -> cat.Drives:
    return cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=100.0, **options)  # type: ignore[arg-type]


def servos(segment: Segment) -> Iterator[Servo]:
    return (device for device in segment if isinstance(device, Servo))


@each(WORKING)
def test_scan(quirk: Quirk) -> None:
    segment = quirk.segment()
    with cat.MainDevice(segment) as main:
        subs = main.scan()
        assert [sub.error for sub in subs] == [None] * 4
        assert [sub.state for sub in subs] == [AlState.PRE_OP] * 4
        assert [sub.identity.serial for sub in subs][QUIRKY:] == [1, 2]
        assert subs[QUIRKY].is_drive
        assert all(text.isprintable() for sub in subs for text in (sub.name, sub.order))
        assert any(quirk.notes in note for note in (*main.notes, ""))
        assert any(quirk.notes in note for note in main.notes) or not quirk.notes


@each(BROKEN)
def test_scan_reports_an_unusable_device(quirk: Quirk) -> None:
    with cat.MainDevice(quirk.segment()) as main:
        subs = main.scan(strict=False)
        error = subs[QUIRKY].error
        assert error is not None
        assert str(error).startswith(f"device {QUIRKY} (Catenary virtual servo)")
        assert quirk.broken in str(error)
        others = [sub for sub in subs if sub.position != QUIRKY]
        assert [sub.error for sub in others] == [None] * 3
        assert [sub.state for sub in others] == [AlState.PRE_OP] * 3
        assert subs[SOUND].sdo.read(*SERIAL, type=UDINT) == 2
        assert any(quirk.notes in note for note in main.notes) or not quirk.notes
        with pytest.raises(CatenaryError, match=f"device {QUIRKY}"):
            main.scan()


@each(WORKING)
def test_bring_up(quirk: Quirk) -> None:
    segment = quirk.segment()
    with cat.MainDevice(segment) as main:
        main.scan()
        lamps = cat.Outputs(main.subs[1])
        with cat.Loop(drives(main), lamps) as loop:
            lamps[lamps.names[0]] = 1
            for _ in range(50):
                next(loop)
            assert {device.state for device in segment} == {OP}
            assert loop.timing.counters["lost"] == 0
        assert all(device.state < OP for device in segment)


@each(WORKING)
def test_motion(quirk: Quirk) -> None:
    segment = quirk.segment()
    with cat.MainDevice(segment) as main:
        main.scan()
        arm = drives(main)
        with cat.Loop(arm) as loop:
            start = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = start + 0.2 * (1 - math.cos(2 * math.pi * cycle.time))
                if cycle.time >= 0.5:
                    break
            run_for(loop, 0.1)
            moved = [servo.position_rad for servo in servos(segment)]
        assert moved[1] == pytest.approx(0.4, abs=0.01)
        assert moved[0] == pytest.approx(0.4 if quirk.moves else 0.0, abs=0.01)


@each(WORKING)
def test_objects(quirk: Quirk) -> None:
    with cat.MainDevice(quirk.segment()) as main:
        main.scan()
        sub = main.subs[QUIRKY]
        for value in (1, 1, 2, 2, 2):  # consecutive equal requests and answers
            assert sub.sdo.read(*SERIAL, type=UDINT) == 1
            sub.sdo.write(SCRATCH, 0, value, type=UINT)
            assert sub.sdo.read(SCRATCH, type=UINT) == value
            assert sub.sdo.read(SCRATCH, type=UINT) == value
        assert sub.sdo.read(LARGE) == bytes(k * 7 & 0xFF for k in range(2048))
        known = {each.index for each in sub.sdo.list()}
        assert {0x1000, 0x1018} <= known
        assert len(known) > 40
        assert sub.sdo.describe(0x1018).entries[1].bit_length == 32


@each(WORKING)
def test_objects_while_running(quirk: Quirk) -> None:
    with cat.MainDevice(quirk.segment()) as main:
        main.scan()
        subs = main.subs.drives
        with cat.Loop(drives(main)) as loop:
            answers = [sub.sdo.request(*SERIAL, type=UDINT) for sub in subs for _ in range(10)]
            for cycle in loop:
                if all(answer.done for answer in answers):
                    break
                assert cycle.number < 5000
            assert loop.timing.counters["lost"] == 0
        assert [answer.result() for answer in answers] == [1] * 10 + [2] * 10


@each(WORKING)
def test_clocks(quirk: Quirk) -> None:
    segment = quirk.segment()
    with cat.MainDevice(segment) as main:
        main.scan()
        with cat.Loop(drives(main, dc=quirk.clock), period=1e-3) as loop:
            loop.wait_locked(within=1e-6, timeout=2.0)
            run_for(loop, 0.2)
            assert loop.clocks.locked
            assert {device.state for device in segment} == {OP}
            assert all(
                abs(math.remainder(difference, 2**32 * 1e-9)) < 1e-6  # a clock can have 32 bits
                for difference in true_differences(segment).values()
            )


@each(WORKING)
def test_names(quirk: Quirk) -> None:
    """Names come from the SII or the dictionary, without control characters."""
    with cat.MainDevice(quirk.segment()) as main:
        main.scan()
        names = cat.Inputs(main.subs[QUIRKY]).names
        assert any(name.endswith("Statusword") for name in names)
        assert all(name.isprintable() for name in names)
        assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", [name for name in QUIRKS if name.startswith("counter")])
@pytest.mark.parametrize("seed", range(3))
def test_lost_frames_with_every_counter(name: str, seed: int) -> None:
    """3 % of the frames are lost in each direction.

    Successive values differ, because without a useful counter an equal answer cannot be
    distinguished from a repetition.
    """
    link = FaultInjector(QUIRKS[name].segment(), seed=seed)
    with cat.MainDevice(link) as main:
        main.scan()
        sub = main.subs[QUIRKY]
        link.inject(
            Fault(kind="lose", direction="sent", probability=0.03),
            Fault(kind="lose", direction="received", probability=0.03),
        )
        for value in range(100):
            sub.sdo.write(SCRATCH, 0, value, type=UINT)
            assert sub.sdo.read(SCRATCH, type=UINT) == value
        assert sub.sdo.read(LARGE) == bytes(k * 7 & 0xFF for k in range(2048))
        link.inject()
        assert link.injected["lose"] > 20
