"""tshark dissects the frames of a bring-up and a run, in both directions."""

from __future__ import annotations

import math
import subprocess
from collections import Counter
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import SdoAbort
from catenary.link import Recorder
from catenary.types import UDINT
from catenary.virtual import demo_segment
from catenary.wire.capture import decode_capture
from catenary.wire.frame import decode_frame

CYCLES = 300


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a scan, SDOs of all lengths, an abort, SAFE-OP, OP, some cycles, and the shutdown."""
    path = tmp_path_factory.mktemp("tshark") / "run.pcapng"
    with Recorder(demo_segment(clock="virtual"), path) as link, cat.MainDevice(link) as main:
        subs = main.scan()
        servo = subs.drives[0]
        servo.sdo.read(0x1018, 1, type=UDINT)
        servo.sdo.read(0x1008)
        servo.sdo.write(0x6065, 0, 5000, type=UDINT)
        with pytest.raises(SdoAbort):
            servo.sdo.read(0x5FFF)
        arm = cat.Drives(subs.drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm, period=1e-3) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 0.1 * math.sin(cycle.time)
                if cycle.number >= CYCLES:
                    break
    assert link.dropped == 0
    return path


def dissect(tshark: str, path: Path, *options: str) -> list[str]:
    command = [tshark, "-r", str(path), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_no_frame_is_malformed(tshark: str, recording: Path) -> None:
    bad = "_ws.malformed || _ws.expert.severity >= 0x600000"  # warnings and errors
    assert dissect(tshark, recording, "-Y", bad) == []


def test_every_frame_is_ethercat(tshark: str, recording: Path) -> None:
    protocols = Counter(dissect(tshark, recording, "-T", "fields", "-e", "frame.protocols"))
    assert sum(protocols.values()) > 2 * CYCLES
    assert [name for name in protocols if "ecat" not in name.split(":")] == []


@pytest.mark.parametrize(
    ("field", "attribute"),
    [("ecat.cmd", "command"), ("ecat.idx", "index"), ("ecat.cnt", "working_counter")],
)
def test_every_datagram_is_recognised(
    tshark: str, recording: Path, field: str, attribute: str
) -> None:
    seen = dissect(tshark, recording, "-T", "fields", "-e", field)
    frames = [decode_frame(p.data) for p in decode_capture(recording.read_bytes()).packets]
    assert [[int(word, 0) for word in line.split(",")] for line in seen] == [
        [getattr(datagram, attribute) for datagram in frame.datagrams] for frame in frames
    ]
