from __future__ import annotations

import math

import numpy as np
import pytest

import catenary as cat
from catenary import sensors
from catenary.sensors import Options, SensorShare
from tests.sensors.scripted import MS, Lines, Script, line
from tests.share.names import own_name

FAST = Options(pause=1e-4, pause_max=2e-4)


class Result:
    """Rows and events that a run has published."""

    def __init__(self, script: Script, decoder: Lines, options: Options = FAST) -> None:
        with (
            own_name("sensor") as name,
            SensorShare(name, decoder.channels, decoder.rate) as share,
        ):
            sensors.run(decoder, script, share, stop=script.stop, options=options)
            with cat.attach(name) as reader:
                self.rows = reader.rows(0)[0].copy()
                self.events = [(e.kind, e.message) for e in reader.events()[0]]

    @property
    def valid(self) -> list[int]:
        return self.rows["valid"].tolist()

    @property
    def reasons(self) -> list[str]:
        return [message for kind, message in self.events if kind == "SensorInvalid"]


def regular(count: int, first: int = 0) -> list[tuple[float, bytes]]:
    return [(2, line(2 * k, k)) for k in range(first, first + count)]


def test_samples_are_published_with_times_of_the_device():
    script = Script(regular(5))
    result = Result(script, Lines())
    assert result.rows["value"].tolist() == [0, 1, 2, 3, 4]
    assert np.diff(result.rows["scheduled_ns"]).tolist() == [2 * MS] * 4
    assert result.valid == [1] * 5
    assert script.written == [b"start", b"stop"]
    assert script.closed == 1


def test_without_a_time_of_the_device_the_reception_less_the_latency_counts():
    options = Options(latency=3e-3)
    result = Result(Script([(2, line(None, 1.0))]), Lines(), options)
    assert result.rows["received_ns"][0] - result.rows["scheduled_ns"][0] == 3 * MS


def test_silence_invalidates_the_sensor_until_the_next_sample():
    decoder = Lines()
    silence = [(10, b""), (10, b""), (10, b""), (10, b"")]
    result = Result(Script([*regular(2), *silence, (2, line(50, 7.0))]), decoder)
    assert result.valid == [1, 1, 0, 1]
    assert np.isnan(result.rows["value"][2])
    assert result.reasons == ["no data"]
    assert decoder.counters.silences == 1


def test_garbage_invalidates_the_sensor_with_advice():
    decoder = Lines()
    garbage = [(5, b"\xff\x00{")] * 6
    result = Result(Script([*regular(2), *garbage]), decoder)
    assert result.valid == [1, 1, 0]
    assert "baud rate" in result.reasons[0]
    assert decoder.counters.garbage == 18


def test_a_device_time_that_goes_back_is_invalid_and_counted():
    decoder = Lines()
    result = Result(Script([*regular(3, first=100), *regular(2)]), decoder)
    assert result.valid == [1, 1, 1, 0, 1]
    assert decoder.counters.time_jumps == 1
    assert result.reasons == ["the time of the device went back or jumped"]


def test_a_lost_connection_is_opened_again_and_the_device_started_again():
    decoder = Lines()
    unplugged = OSError(5, "Input/output error")
    script = Script([*regular(2), unplugged], regular(2, first=5000))
    result = Result(script, decoder)
    assert result.valid == [1, 1, 0, 1, 1]
    assert "Input/output error" in result.reasons[0]
    assert (script.opened, script.closed, decoder.starts) == (2, 2, 2)
    assert decoder.counters.reconnects == 1


def test_a_missing_device_is_reported_and_tried_again():
    missing = FileNotFoundError(2, "No such file or directory")
    result = Result(Script([missing], [missing], regular(1)), Lines())
    assert result.valid == [0, 0, 1]
    assert result.reasons == ["cannot open script: No such file or directory"]


def test_an_exception_stops_the_device():
    script = Script([*regular(1), KeyboardInterrupt()])
    with pytest.raises(KeyboardInterrupt):
        Result(script, Lines())
    assert script.written == [b"start", b"stop"]
    assert script.closed == 1


def test_a_device_that_returns_without_data_reports_it():
    missing = FileNotFoundError(2, "No such file or directory")
    result = Result(Script([missing], [(30, b"\xff")]), Lines())
    assert [reason[:11] for reason in result.reasons] == ["cannot open", "data withou"]


def test_faults_are_logged_once(caplog):
    missing = FileNotFoundError(2, "No such file or directory")
    Result(Script([missing], [missing], regular(1)), Lines())
    assert [record.getMessage().partition(": ")[2] for record in caplog.records] == [
        "cannot open script: No such file or directory",
        "valid again after 2 invalid samples",
    ]


def test_a_silent_device_is_started_again():
    script = Script([*regular(1), (500, b""), (600, b"")], regular(1, first=3000))
    decoder = Lines()
    result = Result(script, decoder)
    assert decoder.starts == 2
    assert result.valid == [1, 0, 1]


@pytest.mark.parametrize("silence", [10.0, math.inf])
def test_a_device_that_sends_only_changes_stays_connected(silence):
    script = Script([*regular(1), (5000, b""), (4000, b""), (2, line(9002, 1.0))])
    decoder = Lines()
    result = Result(script, decoder, Options(silence=silence))
    assert decoder.starts == 1
    assert result.valid == [1, 1]


def test_a_task_raises_the_error_of_its_thread():
    decoder = Lines()
    decoder.channels = ()  # the samples do not match the share
    with own_name("sensor") as name, SensorShare(name, (), 500.0) as share:
        script = Script([(2, line(0, 1.0))])
        with (
            pytest.raises(ValueError, match="the channels are"),
            sensors.Task(decoder, script, share) as task,
        ):
            task._thread.join(10.0)
        with sensors.attach(name) as reader:
            assert "the sensor's thread has failed" in reader.read().reason


@pytest.mark.parametrize(
    "limits",
    [
        {"silence": 0.0},
        {"silence": math.nan},
        {"reopen": -1.0},
        {"latency": -1e-3},
        {"pause_max": 0.01},
    ],
)
def test_a_limit_out_of_range_is_refused(limits):
    with pytest.raises(ValueError, match="must"):
        Options(**limits)
