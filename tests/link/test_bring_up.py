"""A whole bring-up through the wrappers: recorded, replayed without its segment, disturbed."""

from __future__ import annotations

import pytest

from catenary.bus import MainDevice
from catenary.link import Fault, FaultInjector, LinkSource, Recorder, Replay
from catenary.virtual import demo_segment
from tests.link.dissector import dissect


def found(source: LinkSource) -> list[tuple[int, str, object]]:
    with MainDevice(source) as main:
        return [(sub.position, sub.name, sub.identity) for sub in main.scan()]


@pytest.fixture
def recording(tmp_path):
    return tmp_path / "bring-up.pcapng"


def test_a_recorded_bring_up_finds_the_same_devices_when_replayed(recording):
    devices = found(Recorder(demo_segment(), recording))
    replay = Replay(recording)
    assert found(replay) == devices
    assert (replay.unmatched, replay.first_unmatched) == (0, None)


def test_two_recordings_in_virtual_time_are_byte_for_byte_the_same(recording, tmp_path):
    found(Recorder(demo_segment(), recording))
    found(Recorder(demo_segment(), tmp_path / "again.pcapng"))
    assert recording.read_bytes() == (tmp_path / "again.pcapng").read_bytes()


def test_a_foreign_dissector_finds_nothing_malformed(tshark, recording):
    found(Recorder(demo_segment(), recording))
    rows = dissect(tshark, recording, "ecat.cmd", "_ws.malformed")
    assert len(rows) > 100
    assert all(commands and not malformed for commands, malformed in rows)


@pytest.mark.parametrize("kind", ["lose", "duplicate", "delay"])
@pytest.mark.parametrize("direction", ["sent", "received"])
def test_a_disturbed_bring_up_finds_the_same_devices(kind, direction):
    delay = 3e-3 if kind == "delay" else 0.0
    fault = Fault(kind=kind, direction=direction, probability=0.03, delay=delay)
    link = FaultInjector(demo_segment(), fault, seed=1)
    assert found(link) == found(demo_segment())
    assert link.injected[kind] > 0
