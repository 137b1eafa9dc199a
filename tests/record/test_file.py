"""Files are readable by mcap with mcap-ros2-support, by rosbags, and by catenary.

The three readers share no code.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from catenary.errors import RecordingError
from catenary.record.channels import OLD_FORMAT, make_channels
from catenary.record.file import LARGEST_CHUNK, SMALLEST_CHUNK, RecordingFile, chunk_size
from catenary.record.layout import Field, Layout
from catenary.record.recording import read
from catenary.record.repair import repair
from tests.record.made import MONDAY_NS, make_event, make_layout, make_rows

AXES = (0, 1, 6, 33)


def write(path: Path, layout: Layout, count: int = 1200) -> np.ndarray:
    rows = make_rows(layout, count)
    file = RecordingFile(path, layout)
    file.write(rows[:500])
    file.write_event(make_event(500, "DeviceLost", expected=3))
    file.write(rows[500:])
    file.finish({"ended": "the loop ended", "cycles": count, "lost": 0})
    return rows


@pytest.mark.parametrize("axes", AXES)
def test_reading_returns_everything_that_was_written(tmp_path: Path, axes: int) -> None:
    layout = make_layout(axes)
    rows = write(tmp_path / "x.mcap", layout)
    back = read(tmp_path / "x.mcap")
    assert back.layout == layout
    assert back.rows.dtype.names == layout.dtype.names
    assert all(np.array_equal(back[name], rows[name]) for name in layout.dtype.names)
    assert back.events == (make_event(500, "DeviceLost", expected=3),)
    assert (back.ended, back.lost) == ("the loop ended", 0)


@pytest.mark.parametrize("axes", AXES)
def test_mcap_ros2_support_reads_it(tmp_path: Path, axes: int) -> None:
    layout = make_layout(axes)
    rows = write(tmp_path / "x.mcap", layout, 700)
    seen = 0
    with (tmp_path / "x.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            if channel.topic != "/cell_1/cycle":
                continue
            row = rows[seen]
            assert message.log_time == message.publish_time == row["scheduled_ns"] + MONDAY_NS
            assert message.sequence == decoded.number == row["number"]
            assert decoded.door_closed_of_device_4 == row["door closed of device 4"]
            assert decoded.pressure_bar == row["Pressure/bar"]
            if axes:
                assert list(decoded.statusword) == row["statusword"].tolist()
            seen += 1
    assert seen == 700


def test_plotjuggler_reads_it_on_a_machine_that_is_up_for_a_year(tmp_path: Path) -> None:
    """Every integer must be exact as a double.

    Otherwise PlotJuggler's parser throws "Floating point truncated" by default
    (rosx_introspection, conversion_impl.hpp, checkTruncation).
    """
    layout = make_layout(1)
    rows = make_rows(layout, 10)
    rows["scheduled_ns"] += 1 << 53
    file = RecordingFile(tmp_path / "x.mcap", layout)
    file.write(rows)
    file.finish({})
    assert (read(tmp_path / "x.mcap")["scheduled_ns"] == rows["scheduled_ns"]).all()
    with (tmp_path / "x.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = [m for _, c, _, m in reader.iter_decoded_messages() if c.topic.endswith("cycle")]
    times = [m.scheduled.sec * 10**9 + m.scheduled.nanosec for m in messages]
    assert times == rows["scheduled_ns"].tolist()
    for message in messages:
        numbers = [getattr(message, name) for name in message.__slots__ if name != "header"]
        assert all(int(float(n)) == n for n in numbers if isinstance(n, int))


def test_a_recording_of_format_1_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.record.file.FORMAT", OLD_FORMAT)
    monkeypatch.setattr(
        "catenary.record.file.make_channels", lambda layout: make_channels(layout, OLD_FORMAT)
    )
    rows = write(tmp_path / "x.mcap", make_layout(2))
    back = read(tmp_path / "x.mcap")
    assert all(np.array_equal(back[name], rows[name]) for name in rows.dtype.names)


@pytest.mark.parametrize("axes", AXES[1:])
def test_rosbags_reads_it(tmp_path: Path, axes: int) -> None:
    layout = make_layout(axes)
    rows = write(tmp_path / "x.mcap", layout, 600)
    fields = {"position": "position", "velocity": "velocity", "effort": "torque"}
    with AnyReader([tmp_path / "x.mcap"]) as reader:
        for topic, prefix in (("joint_states", ""), ("joint_commands", "commanded_")):
            connections = [c for c in reader.connections if c.topic == f"/cell_1/{topic}"]
            assert [c.msgtype for c in connections] == ["sensor_msgs/msg/JointState"]
            messages = [
                reader.deserialize(raw, connection.msgtype)
                for connection, _, raw in reader.messages(connections)
            ]
            assert {tuple(message.name) for message in messages} == {layout.axes}
            for name, field in fields.items():
                values = np.array([getattr(message, name) for message in messages])
                assert np.array_equal(values, rows[prefix + field])
        stamp = messages[0].header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == rows["scheduled_ns"][0] + MONDAY_NS


def test_events_are_a_log_for_people_and_json_for_programs(tmp_path: Path) -> None:
    layout = make_layout(2)
    file = RecordingFile(tmp_path / "x.mcap", layout)
    file.write(make_rows(layout, 3))
    for kind in ("DeviceReturned", "DeviceLost", "WorkingCounterError"):
        file.write_event(make_event(2, kind))
    file.finish({})
    with AnyReader([tmp_path / "x.mcap"]) as reader:
        logs = [
            reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
            if connection.topic == "/cell_1/log"
        ]
    assert [log.level for log in logs] == [20, 30, 40]
    assert logs[1].msg == "device 2 (elbow) does not answer: DeviceLost"
    assert read(tmp_path / "x.mcap").events[0].kind == "DeviceReturned"


def test_it_is_compressed_in_chunks_with_an_index(tmp_path: Path) -> None:
    write(tmp_path / "x.mcap", make_layout(6), 3000)
    with (tmp_path / "x.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 3 * 3000 + 2
    assert 5 <= len(summary.chunk_indexes) <= 8  # half a second each
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    assert all(index.message_index_offsets for index in summary.chunk_indexes)
    times = [(i.message_start_time, i.message_end_time) for i in summary.chunk_indexes]
    assert times == sorted(times)


def test_a_chunk_is_neither_tiny_nor_huge() -> None:
    assert chunk_size(make_layout(0, period=0.1), []) == SMALLEST_CHUNK
    many = make_layout(300, period=125e-6)

    assert chunk_size(many, make_channels(many)) == LARGEST_CHUNK


def test_an_existing_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_text("precious")
    with pytest.raises(RecordingError, match=r"x\.mcap already exists") as caught:
        RecordingFile(tmp_path / "x.mcap", make_layout(1))
    assert "--force" in caught.value.hint
    assert (tmp_path / "x.mcap").read_text() == "precious"
    RecordingFile(tmp_path / "x.mcap", make_layout(1), force=True).finish({})
    assert len(read(tmp_path / "x.mcap")) == 0


def test_a_field_that_is_not_a_number_is_refused(tmp_path: Path) -> None:
    layout = make_layout(1)
    odd = Layout("x", 1e-3, (), (*layout.fields, Field("label", "<U5")))
    with pytest.raises(RecordingError, match="'label' has dtype <U5"):
        RecordingFile(tmp_path / "x.mcap", odd)
    assert not (tmp_path / "x.mcap").exists()


def test_names_that_collide_get_distinct_field_names(tmp_path: Path) -> None:
    base = make_layout(0)
    twins = tuple(Field(name, "<f8") for name in ("in.0", "IN 0", "header", "2nd", "é", "in"))
    layout = Layout("x", 1e-3, (), (*base.fields, *twins))
    rows = make_rows(layout, 5)
    file = RecordingFile(tmp_path / "x.mcap", layout)
    file.write(rows)
    file.finish({})
    back = read(tmp_path / "x.mcap")
    assert all(np.array_equal(back[f.name], rows[f.name]) for f in layout.fields)
    with AnyReader([tmp_path / "x.mcap"]) as reader:
        connection, _, raw = next(iter(reader.messages()))
        message = reader.deserialize(raw, connection.msgtype)
    assert {"in_0", "in_0_2", "header_2", "x_2nd", "x", "x_in"} <= set(vars(message))


def test_a_file_has_one_recorder(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    first = RecordingFile(path, make_layout(1))
    with pytest.raises(RecordingError, match="is being written by another recorder"):
        RecordingFile(path, make_layout(1), force=True)
    with pytest.raises(RecordingError, match="is being written by another recorder"):
        repair(path)
    first.write(make_rows(make_layout(1), 10))
    first.finish({})
    assert len(read(path)) == 10
    RecordingFile(path, make_layout(1), force=True).finish({})


def test_a_disk_that_is_full_from_the_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(fd: int, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.write", full)
    with pytest.raises(OSError, match=r"No space left on device: '.*x\.mcap'"):
        RecordingFile(tmp_path / "x.mcap", make_layout(1))
