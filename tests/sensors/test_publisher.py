from __future__ import annotations

import pytest

import catenary as cat
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
