from __future__ import annotations

import numpy as np
import pytest

import catenary as cat
from catenary.errors import ShareError
from catenary.sensors import Channel, SensorShare
from tests.share.names import own_name

CHANNELS = [Channel("force", "N", (3,)), Channel("status", dtype="<u4")]
GOOD = {"force": [1.0, 2.0, 3.0], "status": 7}
MS = 1_000_000
START = 1_000_000_000


@pytest.fixture
def share():
    with own_name("wrist") as name, SensorShare(name, CHANNELS, rate=500.0) as made:
        yield made


def test_any_program_reads_the_samples_of_a_sensor(share):
    share.publish(GOOD, START, received_ns=START + MS)
    with cat.attach(share.name) as reader:
        row = reader.read()
    assert row["force"].tolist() == GOOD["force"]
    assert row["scheduled_ns"] == START
    assert row["received_ns"] == START + MS
    assert row["valid"] == 1
    units = {field.name: field.unit for field in reader.layout.fields}
    assert units["force"] == "N"


def rows_and_reasons(share):
    with cat.attach(share.name) as reader:
        events, _ = reader.events()
        return reader.rows(0)[0].copy(), [e.message for e in events if e.kind == "SensorInvalid"]


def test_the_measured_rate_is_that_of_the_samples(share):
    for k in range(100):
        share.publish(GOOD, START + 4 * k * MS)
    rows, _ = rows_and_reasons(share)
    assert rows["measured_rate"][-1] == pytest.approx(250.0)


def test_an_invalidated_sensor_has_no_values(share):
    share.publish(GOOD, START)
    share.invalidate("unplugged", START + MS)
    rows, reasons = rows_and_reasons(share)
    assert rows["valid"].tolist() == [1, 0]
    assert np.isnan(rows["force"][1]).all()
    assert rows["status"][1] == 0
    assert reasons == ["unplugged"]


@pytest.mark.parametrize(
    ("values", "time_ns", "reason"),
    [
        ({**GOOD, "force": [0.0, float("nan"), 0.0]}, START + MS, "not finite"),
        (GOOD, START - MS, "went back"),
        (GOOD, START + 10_000 * MS, "future"),
    ],
)
def test_a_bad_sample_is_invalid_and_reported(share, values, time_ns, reason):
    share.publish(GOOD, START, received_ns=START)
    share.publish(values, time_ns, received_ns=START + 2 * MS)
    rows, reasons = rows_and_reasons(share)
    assert rows["valid"].tolist() == [1, 0]
    assert reason in reasons[0]
    assert rows["scheduled_ns"][1] >= rows["scheduled_ns"][0]


def test_a_wrong_time_in_the_future_does_not_spoil_the_next_samples(share):
    share.publish(GOOD, START + 10_000 * MS, received_ns=START + 50 * MS)
    share.publish(GOOD, START + 2 * MS, received_ns=START + 52 * MS)
    assert rows_and_reasons(share)[0]["valid"].tolist() == [0, 1]


def test_a_reason_that_lasts_is_reported_once(share):
    for k in range(100):
        share.publish(GOOD, START + k * MS, valid=False, reason="overload")
    share.publish(GOOD, START + 200 * MS)
    rows, reasons = rows_and_reasons(share)
    assert reasons == ["overload"]
    assert rows["lost_in_row"][99:].tolist() == [100, 0]


def test_an_alternating_sensor_reports_at_most_once_per_second(share):
    for k in range(0, 3000, 2):
        at = START + k * MS
        share.publish(GOOD, at, valid=False, reason="overload", received_ns=at)
        share.publish(GOOD, at + MS, received_ns=at + MS)
    assert len(rows_and_reasons(share)[1]) == 3


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"force": [1, 2, 3]}, "the channels are"),
        ({**GOOD, "extra": 1}, "the channels are"),
        ({**GOOD, "force": [1, 2]}, "shape"),
        ({**GOOD, "force": 1.0}, "shape"),
    ],
)
def test_values_that_do_not_match_the_channels_are_refused(share, values, message):
    with pytest.raises(ValueError, match=message):
        share.publish(values, START)


@pytest.mark.parametrize(
    "channels",
    [
        [Channel("valid")],
        [Channel("force"), Channel("force")],
        [Channel("")],
        [Channel("force", shape=(0,))],
        [Channel("force", shape=(3, 3))],
        [Channel("force", shape=3)],
        [Channel("force", dtype="S8")],
        [Channel("force", dtype=">f8")],
    ],
)
def test_a_channel_that_cannot_be_shared_is_refused(channels):
    with pytest.raises(ValueError, match=r"in use|must|the shape of a vector"):
        SensorShare("arm.wrist", channels, rate=500.0)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("inf"), float("nan")])
def test_a_rate_out_of_range_is_refused(rate):
    with pytest.raises(ValueError, match="must be positive and finite"):
        SensorShare("arm.wrist", CHANNELS, rate)


def test_a_name_that_is_in_use_is_refused(share):
    with pytest.raises(ShareError, match="belongs to"), SensorShare(share.name, CHANNELS, 1.0):
        pass


def test_a_share_must_be_entered():
    with pytest.raises(RuntimeError, match="not open"):
        SensorShare("arm.wrist", CHANNELS, 500.0).publish(GOOD, START)
