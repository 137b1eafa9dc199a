"""Programs that show or record a loop do the same with a sensor, without a change."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary import record
from catenary.monitor.diagnostics import encode_diagnostics
from catenary.monitor.snapshot import Summaries
from catenary.sensors import Channel, SensorShare
from tests.share.names import own_name

CHANNELS = [Channel("force", "N", (3,)), Channel("temperature", "K")]


@pytest.fixture
def share() -> Iterator[SensorShare]:
    with own_name("wrist") as name, SensorShare(name, CHANNELS, rate=500.0) as made:
        yield made


def publish(share: SensorShare, count: int) -> None:
    for k in range(count):
        values = {"force": [k, 0.0, 0.0], "temperature": 300.0}
        share.publish(values, time.monotonic_ns())


def test_a_recording_has_the_channels_and_events_of_the_sensor(
    share: SensorShare, tmp_path: Path
) -> None:
    with record.Recorder(share.name, tmp_path / "x.mcap") as recorder:
        publish(share, 50)
        share.invalidate("no data")
        recorder.take()
    back = record.read(tmp_path / "x.mcap")
    assert back["force"][:50, 0].tolist() == list(range(50))
    assert back["valid"].tolist() == [1] * 50 + [0]
    assert np.isnan(back["force"][50]).all()
    assert back.unit("force") == "N"
    assert [(e.kind, e.message) for e in back.events] == [("SensorInvalid", "no data")]


def test_the_summary_of_top_and_foxglove_counts_invalid_samples(share: SensorShare) -> None:
    publish(share, 1)
    with cat.attach(share.name) as reader:
        summaries = Summaries(reader)
        publish(share, 10)
        share.invalidate("no data")
        summary = summaries.take()
    assert summary is not None
    assert (summary.bus.cycles, summary.bus.lost, summary.bus.lost_in_row) == (11, 1, 1)
    assert summary.axes == ()
    assert b"1 of 11 cycles lost" in encode_diagnostics(share.name, summary, 0)


def test_the_scope_of_the_dashboard_shows_the_sensor(share: SensorShare) -> None:
    pytest.importorskip("starlette")
    pytest.importorskip("uvicorn")
    from tests.dashboard.serving import serving

    publish(share, 1)
    stop = threading.Event()

    def feed() -> None:
        while not stop.wait(2e-3):
            publish(share, 1)

    thread = threading.Thread(target=feed)
    thread.start()
    try:
        with serving(share.name) as page, page.socket("viewer") as socket:
            hello, status = socket.next("hello"), socket.next("status")
            socket.send("subscribe", id=1, signals=["temperature", "force[0]"], full=True, rate=30)
            frame = socket.frame()
    finally:
        stop.set()
        thread.join()
    fields = [field["name"] for field in hello["layout"]["fields"]]  # type: ignore[index]
    assert {"force", "temperature", "valid", "measured_rate"} <= set(fields)
    assert status["state"] == "running"
    assert frame.values[0][0] == 300.0
