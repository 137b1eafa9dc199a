"""A reader gets every cycle of a loop, by field name, in both execution modes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

import catenary as cat
from catenary.drive import ProcessData
from catenary.errors import DriveError, ShareError
from catenary.loop.publishing import one_sink_each
from catenary.share.reader import Reader
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    DigitalOutputs,
    SafetyLogic,
    SafetyTerminal,
    Segment,
    Servo,
)
from tests.force_sensor import ForceSensor
from tests.share.names import state_file

TURN = 2**20


@cat.law
def hold(actual, target, memory, time):
    for i in range(actual.n):
        target.position[i] = memory[i]
    return time > 0.05


def run(name: str, order: str, body: Callable[[cat.Loop, cat.Drives, Reader], None]) -> None:
    segment = Segment([Coupler(), Servo(), Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives,
            counts_per_turn=TURN,
            velocity_limit=100.0,
            columns=["following_error"],
        )
        share = cat.Share(name)
        with share, cat.Loop(arm, execution=order, sink=share) as loop, cat.attach(name) as reader:  # type: ignore[arg-type]
            body(loop, arm, reader)


@pytest.mark.parametrize("order", ["threaded", "inline"])
def test_reader_gets_the_current_cycle(name: str, order: str) -> None:
    def body(loop: cat.Loop, arm: cat.Drives, reader: Reader) -> None:
        behind = 1 if order == "inline" else 0  # post-processing runs after the body
        seen = []
        for cycle in loop:
            arm.target.position[:] = 0.01 * cycle.time
            now = reader.read()
            seen.append(arm.actual.position.copy())
            if cycle.number > behind:
                assert (now["position"] == seen[-1 - behind]).all()
                assert now["number"] == loop.log["number"][-1] - behind
            if cycle.number == 20:
                assert now["commanded_position"] == pytest.approx(0.01 * 0.019, abs=1e-12)
                break

    run(name, order, body)


@pytest.mark.parametrize("order", ["threaded", "inline"])
def test_no_cycle_is_missing_and_times_match_the_log(name: str, order: str) -> None:
    def body(loop: cat.Loop, arm: cat.Drives, reader: Reader) -> None:
        for cycle in loop:
            if cycle.number == 200:
                break
        rows, lost = reader.rows(after=0)
        assert lost == 0
        assert (rows["number"] == np.arange(1, len(rows) + 1)).all()
        assert (np.diff(rows["scheduled_ns"]) == 1_000_000).all()
        assert (np.diff(rows["time_ns"]) == 1_000_000).all()
        log = loop.log
        kept = rows[-len(log) :] if order == "threaded" else rows[-len(log) + 1 :]
        log = log[-len(kept) - (order == "inline") :][: len(kept)]
        for field in ("number", "period_ns", "receive_ns", "process_ns", "send_ns", "flags"):
            assert (kept[field] == log[field]).all(), field

    run(name, order, body)


@pytest.mark.parametrize("order", ["threaded", "inline"])
def test_reader_gets_the_cycles_of_a_law(name: str, order: str) -> None:
    def body(loop: cat.Loop, arm: cat.Drives, reader: Reader) -> None:
        before = reader.read()["number"]
        loop.run(hold, memory=[0.003, 0.004])
        rows, lost = reader.rows(after=int(before))
        assert lost == 0
        assert (np.diff(rows["number"]) == 1).all()
        assert rows["commanded_position"][-1] == pytest.approx([0.003, 0.004])
        assert rows["target_position"][-1] == pytest.approx([0.003, 0.004])

    run(name, order, body)


@pytest.mark.parametrize("order", ["threaded", "inline"])
def test_quick_stop_is_recorded_in_the_cycle_that_sends_it(name: str, order: str) -> None:
    def body(loop: cat.Loop, arm: cat.Drives, reader: Reader) -> None:
        arm.enable()
        for _ in loop:
            if arm.enabled.all():
                arm.quick_stop()
                asked = int(loop.log["number"][-1])
                break
        loop.run(hold, memory=[0.0, 0.0])
        rows, _ = reader.rows(after=asked - 2)
        words = dict(zip(rows["number"].tolist(), rows["controlword"].tolist(), strict=True))
        assert words[asked - 1] == [0x0F, 0x0F]
        # inline: sent in the same cycle; threaded: sent at the start of the next cycle
        assert words[asked + (order == "threaded")] == [0x02, 0x02]

    run(name, order, body)


def test_layout_describes_the_loop_and_its_fields(name: str) -> None:
    def body(loop: cat.Loop, arm: cat.Drives, reader: Reader) -> None:
        layout = reader.layout
        assert (layout.name, layout.period, layout.clock) == (name, 1e-3, "virtual")
        assert layout.axes == arm.names
        assert layout.writer.is_alive
        units = {field.name: field.unit for field in layout.fields}
        assert units["position"] == "rad"
        assert units["commanded_torque"] == "N·m"
        assert units["lateness_ns"] == "ns"
        per_axis = {f.name: f.dtype for f in layout.fields if f.per_axis}
        assert per_axis.items() >= {"position": "<f8", "state": "u1", "controlword": "<u2"}.items()
        assert reader.dtype["position"].shape == (2,)
        assert reader.read()["following_error"].shape == (2,)

    run(name, "threaded", body)


def test_equal_column_names_are_made_unique(name: str) -> None:
    segment = Segment([Coupler(), AnalogInputs(channels=2), DigitalOutputs(), DigitalOutputs()])
    with cat.MainDevice(segment) as main:
        subs = main.scan()
        inputs, lamps = cat.Inputs(subs[1]), cat.Outputs(subs[2], subs[3])
        with cat.Share(name) as share, cat.Loop(inputs, lamps, sink=share) as loop:
            lamps[lamps.names[0]] = 1
            next(loop)
            next(loop)
            with cat.attach(name) as reader:
                names = [field.name for field in reader.layout.fields]
                assert len(set(names)) == len(names)
                now = reader.read()
                assert now[lamps.names[0]] == 1
                assert now[lamps.names[-1]] == 0
                assert now[inputs.names[0]] == inputs[inputs.names[0]]


def test_rows_contain_raw_process_data(name: str) -> None:
    segment = Segment([Coupler(), ForceSensor(), DigitalOutputs()])
    with cat.MainDevice(segment) as main:
        subs = main.scan()
        sensor, lamps = ProcessData(subs[1]), ProcessData(subs[2])
        with cat.Share(name) as share, cat.Loop(sensor, lamps, sink=share) as loop:
            sensor["Lamp"] = 0x1234
            lamps.outputs[0] = 5
            for _ in range(3):
                next(loop)
            with cat.attach(name) as reader:
                now = reader.read()
                assert now["input_bytes"].tolist() == list(sensor.inputs)
                assert now["output_bytes of device 1"].tolist() == [0, 0x34, 0x12]
                assert now["output_bytes of device 2"].tolist() == [5]


def test_rows_contain_the_safety_frames_of_copies(name: str) -> None:
    segment = Segment([SafetyLogic(), SafetyTerminal(), ForceSensor()])
    with cat.MainDevice(segment) as main:
        subs = main.scan()
        sensor = ProcessData(subs[2])
        ends = [(sub, 0x1A00, 0x1600) for sub in subs[:2]]
        relay = cat.Copies(cat.FsoeConnection(*ends))
        with cat.Share(name) as share, cat.Loop(relay, sensor, sink=share) as loop:
            for _ in range(5):
                next(loop)
            [frames] = relay.fsoe_frames
            with cat.attach(name) as reader:
                now = reader.read()
                assert bytes(now["fsoe_frame of device 0"]) == frames.main
                assert bytes(now["fsoe_frame of device 1"]) == frames.sub
                assert now["input_bytes"].tolist() == list(sensor.inputs)


def test_waiting_ends_with_the_loop(name: str) -> None:
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
        with cat.Share(name) as share:
            with cat.Loop(arm, sink=share) as loop:
                reader = cat.attach(name)
                assert reader.wait(timeout=1.0)
                assert not reader.wait(timeout=0.0)
                next(loop)
                assert reader.wait(timeout=0.0)
                assert reader.alive
            assert reader.wait()  # cycles while the loop shuts down
            assert not reader.wait()
            assert reader.state == "ended"
            assert reader.read()["number"] > 1


def test_last_cycle_is_read_if_the_loop_ends_during_the_check(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("catenary.share.reader.ALIVE_CHECK_NS", 1_000_000)

    def body(loop: cat.Loop, arm: cat.Drives, reader: Reader) -> None:
        reader.read()

        def alive(reader: Reader) -> bool:
            """Run one more cycle, and report the end of the loop."""
            next(loop)
            return False

        monkeypatch.setattr(Reader, "alive", property(alive))
        assert reader.wait()
        assert reader.read()["number"] == loop.log["number"][-1]

    run(name, "threaded", body)


def test_second_loop_creates_a_new_segment(name: str) -> None:
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main, cat.Share(name) as share:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
        with cat.Loop(arm, sink=share) as loop:
            next(loop)
            first = cat.attach(name)
        last = first.read().copy()
        with cat.Loop(arm, period=2e-3, sink=share) as loop:
            next(loop)
            second = cat.attach(name)
            assert second.layout.period == 2e-3
            assert second.rows(after=0)[0]["number"][0] == 1
        assert first.state == "ended"
        assert first.read() == last
    with pytest.raises(ShareError, match=f"no share '{name}'"):
        cat.attach(name)


def test_overwritten_cycles_are_counted(name: str) -> None:
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
        share = cat.Share(name, history=0.1)
        with share, cat.Loop(arm, sink=share) as loop, cat.attach(name) as reader:
            for cycle in loop:
                if cycle.number == 500:
                    break
            rows, lost = reader.rows(after=100)
            assert len(rows) == reader.layout.rows.count == 128
            assert lost == reader.number - 100 - 128
            assert len(reader.rows(after=reader.number)[0]) == 0


def test_events_include_the_error_that_ends_the_loop(name: str) -> None:
    segment = Segment([Coupler(), Servo()])
    with cat.MainDevice(segment) as main, cat.Share(name) as share:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
        reader = None

        def run() -> None:
            nonlocal reader
            with cat.Loop(arm, sink=share) as loop:
                reader = cat.attach(name)
                for cycle in loop:
                    if cycle.number == 10:
                        segment[1].inject_fault(0x2310)  # type: ignore[attr-defined]

        with pytest.raises(DriveError):
            run()
        assert reader is not None
        events, lost = reader.events()
        assert lost == 0
        assert [event.serial for event in events] == list(range(1, len(events) + 1))
        kinds = [event.kind for event in events]
        assert "DriveError" in kinds
        emergency = events[kinds.index("Emergency")]
        assert emergency.position == 1
        assert emergency.details["error_code"] == 0x2310
        assert 10 < emergency.number <= reader.number
        assert reader.events(after=len(events)) == ([], 0)


def test_a_name_in_use_is_refused(name: str) -> None:
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
        with cat.Share(name) as share, cat.Loop(arm, sink=share):
            with pytest.raises(ShareError, match="which is running"), cat.Share(name):
                pass
            with pytest.raises(RuntimeError, match="already belongs to a loop"):
                share.open(None)  # type: ignore[arg-type]


def test_share_that_was_not_entered_is_refused(name: str) -> None:
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
        with (
            pytest.raises(RuntimeError, match="with block"),
            cat.Loop(arm, sink=cat.Share(name)),
        ):
            pass
        assert segment[0].state & 0x0F == 2


def test_each_network_needs_a_sink(name: str) -> None:
    with pytest.raises(ValueError, match="1 given for 2 networks"):
        one_sink_each(cat.Share(name), 2)


def test_two_networks_use_two_shares(name: str) -> None:
    clock = cat.realtime.VirtualClock()
    segments = [Segment([Servo()], clock=clock) for _ in range(2)]
    with cat.MainDevice(segments[0]) as one, cat.MainDevice(segments[1]) as two:
        first, second = (
            cat.Drives(m.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
            for m in (one, two)
        )
        shares = [cat.Share(f"{name}-{k}") for k in range(2)]
        with shares[0], shares[1], cat.Loop(first, second, sink=shares) as loop:
            readers = [cat.attach(f"{name}-{k}") for k in range(2)]
            next(loop)
            before = [reader.number for reader in readers]
            for _ in range(10):
                next(loop)
            assert [r.number - b for r, b in zip(readers, before, strict=True)] == [10, 10]
            rows, lost = readers[1].rows(after=0)
            assert lost == 0
            assert (np.diff(rows["number"]) == 1).all()
        assert [reader.state for reader in readers] == ["ended", "ended"]


@pytest.mark.parametrize("bad", ["", "a/b", "../x", ".hidden", "x" * 65])
def test_invalid_names_are_refused(bad: str) -> None:
    with pytest.raises(ValueError, match="invalid name"):
        cat.Share(bad)
    with pytest.raises(ValueError, match="invalid name"):
        cat.attach(bad)


def test_file_has_the_given_mode(name: str) -> None:
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
        with cat.Share(name, mode=0o640) as share, cat.Loop(arm, sink=share):
            assert state_file(name).stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("order", ["threaded", "inline"])
def test_every_cycle_is_shared_in_real_time(name: str, order: str) -> None:
    """Check that no cycle is missing; timing is not asserted."""
    segment = Segment([Servo()], clock="monotonic")
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=100.0)
        loop = cat.Loop(
            arm,
            period=2e-3,
            execution=order,  # type: ignore[arg-type]
            stop=cat.StopPolicy(lost_limit=1_000_000, late_limit=0, raise_faults=False),
            watchdog=0,
            sink=(share := cat.Share(name)),
        )
        with share, loop, cat.attach(name) as reader:
            for cycle in loop:
                if cycle.number >= 50:
                    break
            assert reader.layout.clock == "monotonic"
            assert reader.wait(timeout=60.0)
            rows, lost = reader.rows(after=0)
            assert lost == 0
            assert (rows["number"] == np.arange(1, len(rows) + 1)).all()
            assert (rows["wake_ns"] >= rows["scheduled_ns"]).all()


def test_patience_waits_for_a_share_to_appear(name: str) -> None:
    tried: list[int] = []

    def jobs() -> Iterator[int]:
        for number in range(3):
            tried.append(number)
            yield number

    with pytest.raises(ShareError, match="there is no share"):
        cat.attach(name, patience=jobs())
    assert tried == [0, 1, 2]

    def body(loop: cat.Loop, arm: cat.Drives, reader: Reader) -> None:
        with cat.attach(name, patience=jobs()) as again:
            assert again.layout == reader.layout

    run(name, "threaded", body)
    assert tried == [0, 1, 2]  # no retry was necessary
