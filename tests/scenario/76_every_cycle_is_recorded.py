"""A humanoid of 33 axes runs at 1 kHz in real time, and another process records it.
The file must contain every cycle, as sent and measured, for readers of ROS 2 bags.
The machine may stall during the recording, because the share buffers the cycles.
"""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import catenary as cat
from catenary import record
from catenary.realtime import VirtualClock
from tests.record.beside import DEADLINE, recorder
from tests.share.names import own_name

AXES, CYCLES = 33, 3000

# In real time, on a machine that may stall: with long timeouts and a large buffer.
WRITER = f"""
import sys
import numpy as np
import catenary as cat

segment = cat.Segment([cat.virtual.Servo() for _ in range({AXES})], clock="monotonic")
with cat.MainDevice(segment) as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20)
    with (
        cat.Share(sys.argv[1], history=8.0) as share,
        cat.Loop(arm, period=1e-3, sink=share,
            stop=cat.StopPolicy(lost_limit=10**6, late_limit=0)) as loop,
    ):
        home = arm.actual.position.copy()
        for done, cycle in enumerate(loop):
            if done == 0:
                print("sharing", flush=True)
            if done == {CYCLES}:
                break
            arm.target.position[:] = home + 1e-6 * done * np.arange(1, {AXES + 1})
    number = loop.log["number"][-1]
    sys.stdin.readline()  # until the recording is closed
print(number, flush=True)
"""


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("humanoid") as name:
        yield name


def test_33_axes_at_1_khz_in_real_time(name: str, tmp_path: Path) -> None:
    path = tmp_path / "humanoid.mcap"
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, name],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as writer:
        assert writer.stdout is not None
        assert writer.stdin is not None
        assert writer.stdout.readline() == "sharing\n"
        with recorder(name, path) as child:
            said, errors = child.communicate(timeout=DEADLINE)
        writer.stdin.write("\n")
        writer.stdin.flush()
        last = int(writer.stdout.readline())
    assert (child.returncode, errors) == (0, "")
    recording = record.read(path)
    assert said.endswith(f": {len(recording)} cycles, none lost; the loop ended\n")
    assert recording.lost == 0
    assert recording["number"].tolist() == list(range(1, last + 1))
    assert last >= CYCLES
    assert recording["position"].shape == (last, AXES)
    judged_by_rosbags(path, recording)


def judged_by_rosbags(path: Path, recording: record.Recording) -> None:
    with AnyReader([path]) as bag:
        counts = {c.topic.rpartition("/")[2]: c.msgcount for c in bag.connections}
        of_commands = [c for c in bag.connections if c.topic.endswith("joint_commands")]
        commands = [
            bag.deserialize(raw, c.msgtype).position for c, _, raw in bag.messages(of_commands)
        ]
    assert {counts[each] for each in ("joint_states", "joint_commands", "cycle")} == {
        len(recording)
    }
    assert np.array_equal(commands, recording["commanded_position"], equal_nan=True)
    steps = np.diff(np.array(commands)[-1500:-500, 0])  # before it stops
    assert np.median(steps) == pytest.approx(1e-6)  # the ramp that the program wrote
    assert abs(steps).max() < 1e-4  # set-points are continued after a late commit, without a jump


def test_a_task_records_every_cycle_in_virtual_time(name: str, tmp_path: Path) -> None:
    """At a hundred times real time, no other process can keep up.

    A task of the program reads the cycles, at the rate of its logging.
    """
    with VirtualClock() as clock:
        segment = cat.Segment([cat.virtual.Servo() for _ in range(6)], clock=clock)
        with cat.MainDevice(segment) as main, cat.Share(name) as share:
            arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
            with cat.Loop(arm, period=1e-3, sink=share) as loop:
                recorder = record.Recorder(name, tmp_path / "x.mcap")
                for cycle in loop:
                    arm.target.position[:] = 0.1 * cycle.time
                    if cycle.number % 100 == 0:
                        recorder.take()
                    if cycle.time > 5.0:
                        break
            recorder.close()  # includes the cycles of the end of the loop
    recording = record.read(tmp_path / "x.mcap")
    assert recording.lost == 0
    assert set(np.diff(recording["number"].astype(int))) == {1}
    assert set(np.diff(recording["scheduled_ns"])) == {1_000_000}
    assert len(recording) >= 5000
