"""The frame engine: frames that are sent, accepted, or counted and dropped."""

from dataclasses import replace

import pytest

from catenary.core import CYCLE_OK, CYCLE_WORKING_COUNTER, Engine
from catenary.plan.cycle import Copy, DatagramKind, SyncUnit
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.core.rig import (
    DRIVE_SIZE,
    LOGICAL,
    Bench,
    ScriptedDrive,
    al_status,
    axis,
    bench,
    cycle_number,
    frame_plan,
    lrw,
    make_plan,
)


def kinds(b: Bench) -> dict[str, int]:
    """The counters that are not zero, without cycles."""
    return {k: v for k, v in b.engine.counters.items() if v and k != "cycles"}


def indices(frame: bytes) -> set[int]:
    return {d.index for d in decode_frame(frame).datagrams}


def test_the_index_changes_every_cycle_and_stays_below_0x80() -> None:
    b = bench(axis(0))
    b.engine.run(300)
    sent = [indices(frame) for frame in b.link.sent]
    assert all(len(s) == 1 for s in sent)
    assert [next(iter(s)) for s in sent] == [k % 128 for k in range(300)]
    assert kinds(b) == {}


def test_outputs_and_inputs_travel_at_their_places() -> None:
    b = bench(axis(0), axis(1))
    b.drives[1].position = 2500
    b.enable()
    b.target_position[:] = (0.25, -3.0)
    b.engine.next()
    assert [d.target_position for d in b.drives] == [250, -3000]
    assert b.actual_position.tolist() == [0.25, -3.0]


def test_a_lost_frame_keeps_the_last_inputs_and_is_counted() -> None:
    b = bench(axis(0))
    b.drives[0].position = 700
    b.engine.run(1)
    b.segment.spoil = lambda frame: []
    flags = [b.engine.next() for _ in range(4)]
    assert [bool(f & CYCLE_OK) for f in flags] == [False] * 4
    assert [bool(f & CYCLE_WORKING_COUNTER) for f in flags] == [False, False, True, True]
    assert b.actual_position[0] == pytest.approx(0.7)
    assert b.engine.lost_in_row == 4
    assert b.engine.missing_frames == 1
    assert kinds(b) == {"lost": 4}
    b.segment.spoil = None
    assert b.engine.next() & CYCLE_OK
    assert b.engine.lost_in_row == 0


def test_a_late_frame_of_an_earlier_cycle_is_stale() -> None:
    b = bench(axis(0))
    b.engine.run(1)
    b.drives[0].position = 5
    b.segment.spoil = lambda frame: [(1_000_000, frame)]  # one whole period
    b.engine.run(1)
    b.drives[0].position = 9
    b.segment.spoil = None
    b.engine.run(1)
    assert kinds(b) == {"lost": 1, "stale": 1}
    assert b.actual_position[0] == pytest.approx(0.009)


def test_a_duplicate_is_used_once() -> None:
    b = bench(axis(0))
    b.segment.spoil = lambda frame: [(100, frame), (100, frame)]
    b.engine.run(3)
    assert b.engine.flags & CYCLE_OK
    b.segment.spoil = None
    b.engine.run(1)
    assert kinds(b)["duplicate"] + kinds(b).get("stale", 0) == 3


@pytest.mark.parametrize(
    "spoil",
    [
        lambda f: f[:12] + b"\x08\x00" + f[14:],  # IPv4
        lambda f: f[:6] + b"\x12\x34\x56\x78\x9a\xbc" + f[12:],  # another MainDevice
        lambda f: f[:13],
    ],
)
def test_alien_frames(spoil) -> None:
    b = bench(axis(0))
    b.segment.spoil = lambda frame: [(100, spoil(frame))]
    b.engine.run(1)
    assert kinds(b) == {"lost": 1, "alien": 1}


def test_a_late_frame_is_not_repeated() -> None:
    b = bench(axis(0))
    b.segment.spoil = lambda frame: [(1_000_000, frame)]
    b.engine.run(20)
    assert kinds(b)["stale"] == 19
    assert b.engine.counters["repeated"] == 0


def numbered(*, divider: int = 1) -> Bench:
    """Two drives in two frames with cycle numbers, the second one with a divider."""
    plan = make_plan([axis(0), axis(1)])
    units = (plan.sync_units[0], SyncUnit("second", (1,), divider=divider))
    slow = replace(frame_plan([lrw(1), cycle_number()]), divider=divider)
    first = frame_plan([al_status(2), lrw(0), cycle_number()])
    return Bench(replace(plan, frames=(first, slow), sync_units=units))


def false_positions(b: Bench) -> int:
    """Repeat every frame 128 frames later, just before the current one, while a drive moves.
    Returns the number of cycles that showed an old position."""
    history: list[bytes] = []

    def repeat(frame: bytes) -> list[tuple[int, bytes]]:
        history.append(frame)
        return [*((100, old) for old in history[-129:-128]), (200, frame)]

    b.segment.spoil = repeat
    false = 0
    for cycle in range(400):
        b.drives[0].position = cycle
        b.engine.run(1)
        false += b.actual_position[0] != pytest.approx(cycle / 1000)
    return false


def test_frames_repeated_128_frames_later_pass_as_current_and_are_counted() -> None:
    b = bench(axis(0))
    assert false_positions(b) == 272
    assert b.ok
    assert b.engine.counters["stale"] == b.engine.counters["repeated"] == 271  # the true ones


@pytest.mark.parametrize("divider", [1, 3])
def test_with_cycle_numbers_no_repeated_frame_passes(divider: int) -> None:
    b = numbered(divider=divider)
    assert false_positions(b) == 0
    assert b.ok
    assert b.engine.counters["lost"] == 0
    assert b.engine.counters["stale"] == b.engine.counters["repeated"] == len(b.link.sent) - 128


def test_cycle_numbers_count_the_cycles() -> None:
    b = numbered(divider=2)
    b.engine.run(4)
    numbers = [
        int.from_bytes(datagram.data, "little")
        for frame in b.link.sent
        for datagram in decode_frame(frame).datagrams
        if datagram.command == EcatCommand.NOP
    ]
    assert numbers == [1, 2, 2, 3, 4, 4]


@pytest.mark.parametrize(
    ("frames", "divider", "exact", "refused"),
    [
        (32, 1, False, None),
        (33, 1, False, "33 in one cycle, at most 32"),
        (63, 2, False, None),
        (64, 2, False, "33 in one cycle, at most 32"),
        (128, 1, True, None),
        (129, 1, True, "129 in one cycle, at most 128"),
        (1025, 100, False, "1025, must be 1 to 1024"),
    ],
)
def test_how_many_frames_a_cycle_may_have(
    frames: int, divider: int, exact: bool, refused: str | None
) -> None:
    parts = [al_status(1), *([cycle_number()] if exact else [])]
    one = frame_plan(parts)
    plan = make_plan(
        frames=tuple(
            replace(one, divider=divider, phase=k % divider) if k else one for k in range(frames)
        ),
        device_count=1,
    )
    if refused:
        with pytest.raises(ValueError, match=refused):
            Bench(plan)
        return
    b = Bench(plan, drives=[ScriptedDrive()])
    b.engine.run(20)
    assert b.ok
    assert kinds(b) == {}


def test_an_index_never_sent_is_alien() -> None:
    b = bench(axis(0))
    b.link.arrive(encode_frame([Datagram(EcatCommand.BRD, 0, bytes(2), index=0x55)]), 1_000_000)
    b.engine.run(1)
    assert kinds(b) == {"alien": 1}
    assert b.ok


@pytest.mark.parametrize(
    "place",
    [14, 15, 16, 20, 22, 30, 31, 32, 33, 36, 37],
    # lengths, commands, ADO, second datagram's command, index, logical address, length
)
def test_a_frame_unlike_its_template_is_corrupt(place: int) -> None:
    b = bench(axis(0))

    def spoil(frame: bytes) -> list[tuple[int, bytes]]:
        return [(100, frame[:place] + bytes([frame[place] ^ 0x11]) + frame[place + 1 :])]

    b.segment.spoil = spoil
    b.engine.run(1)
    assert kinds(b) == {"lost": 1, "corrupt": 1}


def test_a_cut_frame_is_corrupt() -> None:
    b = bench(axis(0), axis(1), axis(2))
    b.segment.spoil = lambda frame: [(100, frame[:70]), (100, frame[:20])]
    b.engine.run(1)
    assert kinds(b) == {"lost": 1, "corrupt": 2}


def test_an_echo_that_met_no_device_is_no_answer() -> None:
    b = bench(axis(0))
    b.link.answer = lambda frame: [(0, frame)]
    b.engine.run(3)
    assert not b.ok
    assert kinds(b) == {"lost": 3, "unprocessed": 3}


def test_an_echo_before_the_answer_does_no_harm() -> None:
    b = bench(axis(0))
    b.link.answer = lambda frame: [(0, frame), *b.segment.answer(frame)]
    b.engine.run(3)
    assert b.ok
    assert kinds(b) == {"unprocessed": 3}


def test_any_bytes_are_counted_and_nothing_worse() -> None:
    b = bench(axis(0))
    b.engine.run(1)
    good = b.segment.answer(b.link.sent[-1])[0][1]
    for length in range(len(good)):
        b.link.arrive(good[:length] or b"\0", 1000)
    for k in range(len(good)):
        b.link.arrive(good[:k] + bytes([good[k] ^ 0xFF]) + good[k + 1 :], 2000)
    b.engine.run(2)
    assert b.actual_position[0] == 0.0
    assert b.ok


def test_a_flood_does_not_hold_the_cycle_up() -> None:
    b = bench(axis(0))
    b.link.arrivals = [(0, encode_frame([Datagram(EcatCommand.NOP, 0, b"")]))] * 1000
    b.engine.run(1)
    assert b.engine.counters["alien"] + b.engine.counters["corrupt"] <= 256
    assert len(b.link.arrivals) >= 700


def test_what_arrived_before_the_start_is_flushed() -> None:
    b = bench(axis(0))
    b.engine.stop()
    b.link.arrive(encode_frame([Datagram(EcatCommand.NOP, 0, b"")]))
    b.engine.start()
    b.engine.run(1)
    assert kinds(b) == {}


# ---- sync units


def test_a_silent_device_leaves_the_other_units_valid() -> None:
    b = bench(axis(0), axis(1))
    b.engine.run(1)
    b.segment.silent = {0}
    b.drives[0].position = b.drives[1].position = 42
    b.engine.run(1)
    assert not b.ok
    assert b.unit_valid.tolist() == [0, 1]
    assert b.unit_counter.tolist() == [0, 3]
    assert b.actual_position.tolist() == [0.0, 0.042]
    assert b.engine.al_counter == 1


def test_the_loss_of_an_optional_unit_does_not_spoil_the_cycle() -> None:
    plan = make_plan([axis(0), axis(1)])
    plan = replace(plan, sync_units=(plan.sync_units[0], SyncUnit("extra", (1,), optional=True)))
    b = Bench(plan)
    b.segment.silent = {1}
    b.engine.run(5)
    assert b.ok
    assert b.unit_valid.tolist() == [1, 0]
    assert b.engine.counters["lost"] == 0


def two_frames(optional: bool) -> Bench:
    plan = make_plan([axis(0), axis(1)])
    units = (plan.sync_units[0], SyncUnit("second", (1,), optional=optional))
    frames = (frame_plan([al_status(2), lrw(0)]), frame_plan([lrw(1)]))
    return Bench(replace(plan, frames=frames, sync_units=units))


def test_several_frames_have_indices_of_their_own() -> None:
    b = two_frames(optional=False)
    b.engine.run(100)
    assert b.ok
    assert [next(iter(indices(f))) for f in b.link.sent] == [k % 128 for k in range(200)]


@pytest.mark.parametrize("optional", [False, True])
def test_a_lost_second_frame(optional: bool) -> None:
    b = two_frames(optional)
    b.segment.spoil = lambda frame: [(1, frame)] if len(decode_frame(frame).datagrams) > 1 else []
    b.engine.run(1)
    assert b.ok == optional
    assert b.unit_valid.tolist() == [1, 0]
    assert b.engine.missing_frames == 1


# ---- units that are exchanged every few cycles


def slow_second(divider: int, phase: int = 0, **options: object) -> Bench:
    """The second of two drives is in a separate frame with a divider."""
    plan = make_plan([axis(0), axis(1)], **options)
    units = (plan.sync_units[0], SyncUnit("second", (1,), divider=divider))
    slow = replace(frame_plan([lrw(1)]), divider=divider, phase=phase)
    return Bench(replace(plan, frames=(frame_plan([al_status(2), lrw(0)]), slow), sync_units=units))


def test_a_unit_with_a_divider_is_sent_only_in_its_cycles() -> None:
    b = slow_second(divider=4, phase=1)
    b.engine.run(12)
    assert [len(decode_frame(f).datagrams) for f in b.link.sent] == [2, 1, 2, 2, 2] * 3
    assert b.ok
    assert b.engine.counters["lost"] == 0


def test_between_its_exchanges_a_slow_unit_keeps_its_inputs() -> None:
    b = slow_second(divider=3)
    b.engine.run(3)
    b.drives[1].position = 1000
    b.engine.run(2)
    assert (b.actual_position[1], b.unit_valid.tolist()) == (0.0, [1, 1])
    b.engine.run(1)
    assert b.actual_position[1] == 1.0


def test_a_silent_slow_unit_counts_its_own_exchanges_in_a_row() -> None:
    """Good cycles between them do not make it forgotten, nor are they counted as lost."""
    b = slow_second(divider=3, lost_limit=3)
    b.engine.run(3)
    b.segment.silent = {1}
    b.engine.run(3)
    assert (b.engine.lost_in_row, b.engine.counters["lost"]) == (1, 1)
    assert not b.engine.flags & CYCLE_WORKING_COUNTER
    b.engine.run(6)
    assert (b.engine.lost_in_row, b.engine.counters["lost"]) == (3, 3)
    assert b.engine.flags & CYCLE_WORKING_COUNTER
    b.segment.silent = set()
    b.engine.run(3)
    assert (b.engine.lost_in_row, b.unit_valid.tolist()) == (0, [1, 1])


@pytest.mark.parametrize(("divider", "phase"), [(0, 0), (3, 3), (3, -1), (20_000, 0)])
def test_a_divisor_that_makes_no_sense_is_refused(divider: int, phase: int) -> None:
    with pytest.raises((ValueError, OverflowError), match=r"divider|negative"):
        slow_second(divider, phase)


def test_a_unit_in_frames_of_different_cycles_is_refused() -> None:
    plan = make_plan([axis(0)])
    again = replace(frame_plan([lrw(0)]), divider=2)
    with pytest.raises(ValueError, match="the same divider and phase"):
        Bench(replace(plan, frames=(frame_plan([al_status(1), lrw(0)]), again)))


def test_a_unit_of_lrd_and_lwr_needs_both_before_its_inputs_count() -> None:
    lrd = Datagram(EcatCommand.LRD, LOGICAL, bytes(DRIVE_SIZE))
    lwr = Datagram(EcatCommand.LWR, LOGICAL, bytes(DRIVE_SIZE))
    data = DatagramKind.PROCESS_DATA
    frames = (frame_plan([(data, lrd, 1, 0)]), frame_plan([(data, lwr, 1, 0)]))
    b = Bench(replace(make_plan([axis(0)]), frames=frames))
    b.drives[0].position = 3000

    def process(datagram: Datagram) -> Datagram:
        if datagram.command == EcatCommand.LRD:
            return replace(datagram, data=b.drives[0].inputs(), working_counter=1)
        return replace(datagram, working_counter=writes)

    b.segment.process = process  # type: ignore[method-assign]
    writes = 0
    b.engine.run(1)
    assert not b.ok
    assert b.actual_position[0] != 3.0
    writes = 1
    b.engine.run(1)
    assert b.ok
    assert b.actual_position[0] == 3.0


def test_al_status_is_the_or_of_all_and_how_many_answered() -> None:
    b = bench(axis(0), axis(1))
    b.segment.al_state = 0x14
    b.engine.run(1)
    assert (b.engine.al_status, b.engine.al_counter) == (0x14, 2)
    b.segment.spoil = lambda frame: []
    b.engine.run(1)
    assert (b.engine.al_status, b.engine.al_counter) == (0x14, 0)  # the last that was received


def test_a_link_that_does_not_send_is_counted_and_the_cycle_is_lost() -> None:
    b = bench(axis(0))
    b.link.send_result = -105
    b.engine.run(2)
    assert kinds(b) == {"lost": 2, "send_errors": 2}


# ---- receive modes


def test_poll_mode_waits_for_the_deadline_and_reads_once() -> None:
    b = bench(axis(0), receive_mode="poll")
    b.engine.run(2)
    assert b.ok
    assert b.link.waits == [1_000_000, 1_500_000, 2_000_000, 2_500_000]


def test_wait_returns_with_the_frame() -> None:
    b = bench(axis(0), receive_mode="wait")
    b.engine.run(1)
    assert b.ok
    assert b.link.time == 1_100_000


def test_wait_gives_up_at_the_deadline() -> None:
    b = bench(axis(0), receive_mode="wait")
    b.segment.delay = 600_000
    b.engine.run(1)
    assert not b.ok
    assert b.link.time == 1_500_000


# ---- a plan that cannot be is refused, with the number


def bad(change) -> object:
    plan = make_plan([axis(0)])
    frame = plan.frames[0]
    return replace(plan, **change(plan, frame, frame.datagrams[1]))


def with_datagram(frame, **changes) -> dict[str, object]:
    first, second = frame.datagrams
    return {"frames": (replace(frame, datagrams=(first, replace(second, **changes))),)}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p, f, d: {"frames": ()}, "frames: 0"),
        (lambda p, f, d: {"frames": (f,) * 33}, "frames: 33"),
        (lambda p, f, d: {"frames": (replace(f, template=f.template[:40]),)}, "40 bytes"),
        (lambda p, f, d: {"frames": (replace(f, datagrams=()),)}, "no datagrams"),
        (lambda p, f, d: with_datagram(f, offset=31), "must be at 30"),
        (lambda p, f, d: with_datagram(f, length=14), "the end of its datagrams at"),
        (lambda p, f, d: with_datagram(f, command=3), "command or length"),
        (lambda p, f, d: with_datagram(f, sync_unit=1), "no sync unit 1"),
        (lambda p, f, d: with_datagram(f, expected_counter=70000), "counter 70000"),
        (lambda p, f, d: with_datagram(f, inputs=(Copy(40, 1, 13),)), "exceeds the image"),
        (lambda p, f, d: with_datagram(f, outputs=(Copy(39, 0, 2),)), "exceeds the data"),
        (lambda p, f, d: with_datagram(f, outputs=(Copy(40, -1, 2),)), "exceeds the image"),
        (lambda p, f, d: {"output_size": -1}, "output_size"),
        (lambda p, f, d: {"receive_mode": "listen"}, "listen"),
        (lambda p, f, d: {"execution": "sideways"}, "sideways"),
        (lambda p, f, d: {"period_ns": 0}, "period_ns"),
        (lambda p, f, d: {"collect_deadline_ns": 2_000_000}, "collect_deadline_ns"),
        (lambda p, f, d: {"priority": 100}, "priority"),
        (lambda p, f, d: {"lost_limit": 0}, "lost_limit"),
        (lambda p, f, d: {"axes": (axis(1),)}, "no sync unit 1"),
        (lambda p, f, d: {"axes": (axis(0, controlword=None),)}, "controlword"),
        (lambda p, f, d: {"axes": (axis(0, actual_position=None),)}, "cannot be held"),
    ],
)
def test_impossible_plans(change, message: str) -> None:
    b = bench(axis(0))
    with pytest.raises(ValueError, match=message):
        Engine(bad(change), b.link.capsule)


def test_only_a_link_capsule_is_a_link() -> None:
    with pytest.raises(ValueError, match=r"catenary\.link"):
        Engine(make_plan([axis(0)]), object())
