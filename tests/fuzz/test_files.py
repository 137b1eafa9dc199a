"""Untrusted files: each parser returns a value or raises its documented error."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from catenary.cli.sii_text import text_lines, tolerant
from catenary.doctor.change import HostState, MachineGround, Made, StateError, undo
from catenary.errors import ConfigurationError, DecodeError, RecordingError, ShareError
from catenary.link import Replay
from catenary.realtime.analysis_file import read_demands
from catenary.record.channels import FORMAT, encode_text, make_channels
from catenary.record.mcap_records import END_RECORD, LAYOUT_RECORD
from catenary.record.recording import read
from catenary.record.repair import repair
from catenary.share.events import decode_event
from catenary.share.layout import HEADER, MAGIC, VERSION, decode_head, encode_head, make_layout
from catenary.share.process import this_process
from catenary.share.reader import Reader
from catenary.virtual import read_segment
from catenary.virtual.configuration import SegmentFile
from catenary.wire.pcapng import Direction, Packet, encode_header, encode_packet
from catenary.wire.sii_check import objections
from tests.fuzz.fuzz_wire import SII
from tests.link.python_link import frame
from tests.record.made import make_event, make_rows
from tests.record.made import make_layout as make_recording_layout
from tests.share.test_hammer import LAYOUT as SINK_LAYOUT

NUMBERS: st.SearchStrategy[Any] = st.one_of(
    st.sampled_from([0, -1, 1, 2, 255, 256, 65535, 65536, 2**31, 2**32, 2**62, 2**63 - 1]),
    st.sampled_from([0.0, -1.0, 1e-320, 1e-9, 1.0, 1e9, 1e300, float("inf"), float("nan")]),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
)
PLAIN = st.one_of(NUMBERS, st.booleans(), st.text(max_size=8), st.lists(NUMBERS, max_size=3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("files")


def toml(value: object) -> str:
    """Return a value in TOML syntax."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value).replace("NaN", "nan").replace("Infinity", "inf")


def names_of(part: Any) -> dict[str, list[str]]:
    """Return the fields of each kind of table, from the type of the file."""
    [field] = [each for each in msgspec.structs.fields(SegmentFile) if each.name == part]
    members = field.type.__args__[0].__args__
    return {
        member.__struct_config__.tag: [each.encode_name for each in msgspec.structs.fields(member)]
        for member in members
    }


def table(kinds: dict[str, list[str]], values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    def of(kind: str) -> st.SearchStrategy[dict[str, Any]]:
        given = st.dictionaries(st.sampled_from(kinds[kind]), values, max_size=3)
        return given.map(lambda fields: {"kind": kind, **fields})

    return st.sampled_from(sorted(kinds)).flatmap(of)


CRYSTAL = st.fixed_dictionaries({}, optional=dict.fromkeys(("ppm", "jitter", "drift_ppm"), NUMBERS))
DEVICE = table(names_of("device"), NUMBERS | PLAIN | CRYSTAL)
PLACES = st.lists(st.sampled_from(["main", 0, 1, 2, -1]), min_size=2, max_size=2)
FAULT = table(names_of("fault"), NUMBERS | PLAIN | PLACES | DEVICE | st.integers(0, 2))


@given(
    devices=st.lists(DEVICE, max_size=3),
    faults=st.lists(FAULT, max_size=3),
    loss=st.none() | NUMBERS,
)
@settings(max_examples=300)
def test_a_segment(folder: Path, devices: list[Any], faults: list[Any], loss: Any) -> None:
    path = folder / "segment.toml"
    parts = [f"link_loss_detection = {toml(loss)}"] * (loss is not None)
    parts += [f"device = {toml(devices)}", f"fault = {toml(faults)}"]
    path.write_text("\n".join(parts))
    with_error(lambda: read_segment(path), ConfigurationError)


EXTREMES = (-1, 65536, 2**63 - 1, 1e300, float("nan"), [2**40, 0])
NEEDED = {"device": 0, "other": 1, "between": ["main", 0], "state": "OP", "code": 1}


@pytest.mark.parametrize("kind", sorted(names_of("device")))
def test_every_field_of_a_device_out_of_range(folder: Path, kind: str) -> None:
    path = folder / "extreme.toml"
    for field in names_of("device")[kind]:
        for value in EXTREMES:
            path.write_text(f"device = [{toml({'kind': kind, field: value})}]")
            with_error(lambda: read_segment(path), ConfigurationError)


@pytest.mark.parametrize("kind", sorted(names_of("fault")))
def test_every_field_of_a_fault_out_of_range(folder: Path, kind: str) -> None:
    path = folder / "extreme.toml"
    fields = names_of("fault")[kind]
    needed = {field: NEEDED[field] for field in fields if field in NEEDED}
    if "with" in fields:
        needed["with"] = {"kind": "servo", "alias": 70_000}
    for field in fields:
        for value in EXTREMES:
            fault = toml({**needed, "kind": kind, field: value})
            devices = '[{kind = "servo"}, {kind = "servo"}]'
            path.write_text(f"device = {devices}\nfault = [{fault}]")
            with_error(lambda: read_segment(path), ConfigurationError)


TASK = st.dictionaries(
    st.sampled_from(["name", "period", "execution", "deadline", "blocking", "jitter", "cpu"]), PLAIN
)


@given(tasks=st.lists(TASK, max_size=3))
def test_tasks(folder: Path, tasks: list[Any]) -> None:
    path = folder / "tasks.toml"
    path.write_text(f"task = {toml(tasks)}")
    with_error(lambda: read_demands(path), ConfigurationError)


@pytest.mark.parametrize(
    "content", [b"\xff\xfe", b"a = " + b"[" * 5000, b"a = 1" + b"0" * 5000, b"\0", b"= = ="]
)
@pytest.mark.parametrize("reading", [read_segment, read_demands])
def test_invalid_toml(folder: Path, content: bytes, reading: Callable[[Path], object]) -> None:
    path = folder / "none.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigurationError, match=r"none\.toml"):
        reading(path)


def with_error(action: Callable[[], object], *kinds: type[Exception]) -> None:
    """Run a function. Only the given errors are documented."""
    try:
        action()
    except kinds:
        return


def damaged(whole: bytes, most: int = 4) -> st.SearchStrategy[bytes]:
    """Draw bytes of which some are replaced or cut off."""
    places = st.tuples(st.integers(0, max(len(whole) - 1, 0)), st.binary(min_size=1, max_size=4))

    def apply(changes: list[tuple[int, bytes]], kept: int) -> bytes:
        data = bytearray(whole)
        for at, written in changes:
            data[at : at + len(written)] = written
        return bytes(data[:kept])

    kept = st.just(len(whole)) | st.integers(0, len(whole))
    return st.builds(apply, st.lists(places, max_size=most), kept)


# The EEPROM


@given(image=damaged(SII) | st.binary(max_size=300))
@settings(max_examples=200)
def test_an_image_of_an_eeprom(image: bytes) -> None:
    objections(image)
    with_error(lambda: text_lines(tolerant(image)), DecodeError)


# Recordings: whole chunks with valid checksums and invented content

ROWS_LAYOUT = make_recording_layout(1)
ROWS = make_rows(ROWS_LAYOUT, 3)
DESCRIPTION = msgspec.json.encode(ROWS_LAYOUT)
EVENT = encode_text(msgspec.json.encode(make_event(2)).decode())


def write_recording(path: Path, description: bytes, messages: list[tuple[str, int, bytes]]) -> None:
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "made up")
        text = description.decode(errors="replace")
        writer.add_metadata(LAYOUT_RECORD, {"format": FORMAT, "layout": text})
        channels: dict[str, int] = {}
        for topic, sequence, data in messages:
            if topic not in channels:
                schema = writer.register_schema("any", "ros2msg", b"")
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], sequence, data, sequence, sequence)
        writer.add_metadata(END_RECORD, {"ended": "so", "lost": "x"})
        writer.finish()


def messages_of(rows: Any) -> list[tuple[str, int, bytes]]:
    times = rows["scheduled_ns"].astype(np.int64)
    made = []
    for channel in make_channels(ROWS_LAYOUT):
        data, size = channel.encode(rows, times), len(channel.message.constant)
        made += [(channel.topic, n + 1, data[n * size : (n + 1) * size]) for n in range(len(rows))]
    return made


GOOD = [*messages_of(ROWS), ("/cell_1/events", 2, EVENT)]
MESSAGES = st.lists(
    st.sampled_from(GOOD).flatmap(
        lambda message: st.tuples(
            st.just(message[0]), st.just(message[1]) | st.integers(0, 4), damaged(message[2], 2)
        )
    ),
    max_size=8,
)


@given(description=damaged(DESCRIPTION), messages=MESSAGES)
@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow])
def test_a_recording(
    folder: Path, description: bytes, messages: list[tuple[str, int, bytes]]
) -> None:
    pytest.importorskip("mcap", reason="recordings need catenary[log]")
    path = folder / "made_up.mcap"
    write_recording(path, description, [*GOOD, *messages])
    with_error(lambda: read(path), RecordingError)
    write_recording(path, DESCRIPTION, [*GOOD, *messages])
    with_error(lambda: read(path).time, RecordingError)
    with_error(lambda: repair(path), RecordingError)


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d.update(period=0.0),
        lambda d: d.update(period=-1.0),
        lambda d: d["fields"].pop(0),
        lambda d: d["fields"].pop(1),
        lambda d: d["fields"].append(d["fields"][0]),
        lambda d: d["fields"][0].update(dtype="O"),
        lambda d: d["fields"][0].update(shape=[2**40]),
        lambda d: d["fields"][0].update(dtype="nonsense"),
    ],
)
def test_a_recording_of_an_impossible_layout(folder: Path, change: Callable[[Any], object]) -> None:
    pytest.importorskip("mcap", reason="recordings need catenary[log]")
    layout = json.loads(DESCRIPTION)
    change(layout)
    path = folder / "impossible.mcap"
    write_recording(path, json.dumps(layout).encode(), GOOD)
    with pytest.raises(RecordingError):
        read(path)


# Captures

QUESTION, ANSWER = frame(b"ask!"), frame(b"say!")
CAPTURE = b"".join(
    (
        encode_header("eth0"),
        encode_packet(Packet(1_000, QUESTION, direction=Direction.OUTBOUND)),
        encode_packet(Packet(9_000, ANSWER, direction=Direction.INBOUND)),
    )
)


@given(data=damaged(CAPTURE))
@settings(max_examples=200)
def test_a_replayed_capture(folder: Path, data: bytes) -> None:
    path = folder / "replayed.pcapng"
    path.write_bytes(data)
    with_error(lambda: Replay(path), DecodeError)


def test_a_frame_with_a_far_future_time_is_not_an_answer(folder: Path) -> None:
    path = folder / "centuries.pcapng"
    late = encode_packet(Packet(2**64 - 1, ANSWER, direction=Direction.INBOUND))
    path.write_bytes(CAPTURE[: -len(late)] + late)
    with pytest.raises(DecodeError, match="no frame that came back"):
        Replay(path)
    with pytest.raises(ValueError, match="a wrong time"):
        Replay([(QUESTION, ANSWER, 2**63)])  # type: ignore[list-item]


# Shares

SHARE = make_layout("x", SINK_LAYOUT, history=1e-3, opened=0.0, writer=this_process())
HEAD = encode_head(SHARE)


TURNED = (ValueError, OverflowError)  # `attach` turns them into a ShareError


class Mapped:
    """A shared-memory segment without a file."""

    def __init__(self, content: bytes) -> None:
        self.memory = content
        self.size = len(content)
        self.path = Path("/dev/shm/catenary-0/share-x")
        self.owner = 0


def look(content: bytes) -> None:
    """Do what `attach` and a reader do."""
    layout = decode_head(content, len(content))
    try:
        reader = Reader(Mapped(content), layout)  # type: ignore[arg-type]
    except TURNED:
        return
    reader.rows(after=0)
    reader.events()
    assert reader.wait(timeout=0.0) in (True, False)
    if reader.number:
        reader.read()


@given(data=damaged(HEAD + bytes(SHARE.size - len(HEAD))), head=damaged(HEAD))
@settings(max_examples=200)
def test_a_share(data: bytes, head: bytes) -> None:
    with_error(lambda: look(data), ShareError)
    with_error(lambda: look(head.ljust(SHARE.size, b"\0")), ShareError)


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["fields"][0].update(dtype="O"),
        lambda d: d["fields"][0].update(dtype="nonsense"),
        lambda d: d["fields"][0].update(dtype="V8"),
        lambda d: d["fields"][0].update(offset=-8),
        lambda d: d["fields"][0].update(offset=2**40),
        lambda d: d["fields"][0].update(shape=[2**40]),
        lambda d: d["rows"].update(count=-1),
        lambda d: d["rows"].update(size=0),
        lambda d: d["events"].update(offset=2**64),
        lambda d: d.update(period=0.0),
        lambda d: d.update(fields="[" * 3000),
    ],
)
def test_a_share_of_an_impossible_layout(change: Callable[[Any], object]) -> None:
    layout = json.loads(HEAD[HEADER.size :])
    change(layout)
    text = json.dumps(layout).encode()
    size = SHARE.size + 4096
    content = (HEADER.pack(MAGIC, VERSION, len(text), size) + text).ljust(size, b"\0")
    with pytest.raises((ShareError, *TURNED)):
        Reader(Mapped(content), decode_head(content, size))  # type: ignore[arg-type]


@given(row=damaged(msgspec.json.encode(make_event(3))) | st.binary(max_size=40))
def test_an_event_of_a_share(row: bytes) -> None:
    with_error(lambda: decode_event(row), ShareError)


# The doctor's state

STATE = msgspec.json.encode({"boot": "b", "made": [{"target": "/x", "before": "1", "after": "2"}]})


@given(content=damaged(STATE) | st.recursive(PLAIN, st.lists).map(lambda v: json.dumps(v).encode()))
@settings(max_examples=200)
def test_a_state_of_the_doctor(folder: Path, content: bytes) -> None:
    state = HostState(folder / "doctor.json", "b")
    state.path.write_bytes(content)
    state.path.chmod(0o600)
    with_error(lambda: list(undo(MachineGround(folder), state)), StateError)


@given(target=st.text(), before=st.text(), after=st.text())
@example(target="\x00", before="", after="")
def test_an_invented_change(folder: Path, target: str, before: str, after: str) -> None:
    """Saving and undoing succeed, or raise the documented error."""
    state = HostState(folder / "doctor.json", "b")
    with_error(lambda: state.save([Made(target, before, after)]), StateError, UnicodeEncodeError)
    with_error(lambda: list(undo(MachineGround(folder), state)), StateError)


def test_a_deeply_nested_state(folder: Path) -> None:
    state = HostState(folder / "deep.json", "b")
    state.path.write_bytes(b'{"boot": "b", "x": ' + b"[" * 100_000)
    os.chmod(state.path, 0o600)
    with pytest.raises(StateError):
        state.load()
