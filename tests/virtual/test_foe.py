"""Files of a virtual device: FoE at message level, BOOT, and the firmware."""

from __future__ import annotations

import struct
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.virtual import (
    AnalogInputs,
    DeviceFiles,
    DeviceFirmware,
    Segment,
    make_firmware,
    read_segment,
)
from catenary.virtual.foe.server import FileServer
from catenary.virtual.foe.store import FileStore
from catenary.wire.foe import decode_foe
from tests.virtual.main_device import STATION, MainDevice

INIT, PRE_OP, BOOT, SAFE_OP, OP = 1, 2, 3, 4, 8
ERROR = ACKNOWLEDGE = 0x10
RRQ, WRQ, DATA, ACK, ERR, BUSY = 1, 2, 3, 4, 5, 6
FOE = 4
ROOM, BOOT_ROOM = 128 - 12, 256 - 12  # data of a full packet
PRODUCT = 0x0004_0002
FIRMWARE = DeviceFiles(firmware=DeviceFirmware())


class Client:
    """FoE messages to one device, each as bytes."""

    def __init__(self, device: AnalogInputs) -> None:
        self.device = device
        self.main = MainDevice(Segment([device]))
        self.main.number_stations()
        self.size = 128

    def start(self, state: int = PRE_OP) -> None:
        """Bring the device from INIT to PRE-OP or BOOT."""
        assert self.configure(128 if state == PRE_OP else 256, state) == (state, 0)

    def configure(self, size: int, state: int) -> tuple[int, int]:
        """Configure mailboxes of `size` bytes and request a state."""
        for n in (0, 1):
            self.main.write(STATION, 0x0806 + 8 * n, b"\0")
        self.main.sync_manager(STATION, 0, 0x1000, size, 0x26)
        self.main.sync_manager(STATION, 1, 0x1000 + size, size, 0x22)
        self.size = size
        return self.main.request(STATION, state)

    def ask(self, code: int, number: int, rest: bytes = b"") -> tuple[int, int, bytes]:
        """Send a message. Return op-code, number and the rest of the answer."""
        self.send(code, number, rest)
        answer = self.main.fetch(STATION, self.size)
        assert answer is not None
        assert answer[5] & 0x0F == FOE
        return (*struct.unpack_from("<BxI", answer, 6), answer[12:])

    def send(self, code: int, number: int, rest: bytes = b"") -> None:
        payload = struct.pack("<BxI", code, number) + rest
        assert self.main.put(STATION, payload, kind=FOE, size=self.size) == 1

    def silent(self) -> bool:
        return self.main.fetch(STATION, self.size) is None

    def write(self, name: bytes, data: bytes, room: int) -> tuple[int, int, bytes]:
        """Write a file. Return the last answer."""
        answer = self.ask(WRQ, 0, name)
        for packet, start in enumerate(range(0, len(data) + 1, room), 1):
            if answer[0] != ACK:
                return answer
            answer = self.ask(DATA, packet, data[start : start + room])
        return answer

    def object(self, index: int, subindex: int = 0) -> bytes:
        return self.device.application.dictionary.entry(index, subindex).read()


def client(files: DeviceFiles) -> Client:
    """Return a client of a device with mailboxes of 256 bytes in BOOT, unless `files` differs."""
    if files.bootstrap_bytes is None:
        files = msgspec.structs.replace(files, bootstrap_bytes=256)
    return Client(AnalogInputs(files=files))


def in_pre_op(**options: object) -> Client:
    made = client(DeviceFiles(**options))  # type: ignore[arg-type]
    made.start()
    return made


def test_a_file_is_read_in_packets() -> None:
    made = in_pre_op(contents={"log": bytes(range(ROOM)) + b"rest"})
    assert made.ask(RRQ, 0, b"log") == (DATA, 1, bytes(range(ROOM)))
    assert made.ask(ACK, 1) == (DATA, 2, b"rest")
    made.send(ACK, 2)
    assert made.silent()


def test_a_file_of_full_packets_ends_with_an_empty_one() -> None:
    made = in_pre_op(contents={"log": bytes(ROOM), "empty": b""})
    assert made.ask(RRQ, 0, b"log") == (DATA, 1, bytes(ROOM))
    assert made.ask(ACK, 1) == (DATA, 2, b"")
    made.send(ACK, 2)
    assert made.silent()
    assert made.ask(RRQ, 0, b"empty") == (DATA, 1, b"")


@pytest.mark.parametrize("size", [0, 1, ROOM, ROOM + 1, 5 * ROOM])
def test_a_file_is_written_when_its_last_packet_arrives(size: int) -> None:
    made = in_pre_op(contents={"a": b"old"})
    data = bytes(k & 0xFF for k in range(size))
    assert made.write(b"a", data, ROOM) == (ACK, size // ROOM + 1, b"")
    assert made.device.store.files == {"a": data}


def test_an_incomplete_file_is_not_stored() -> None:
    made = in_pre_op(contents={"a": b"old"})
    made.ask(WRQ, 0, b"a")
    made.ask(DATA, 1, bytes(ROOM))
    assert made.device.store.files == {"a": b"old"}


REFUSED = {
    "not found": (dict(), RRQ, 0, b"log", 0x8001),
    "no new files": (dict(new_files=False), WRQ, 0, b"log", 0x8001),
    "write-protected": (dict(write_protected=("log",)), WRQ, 0, b"log", 0x8002),
    "wrong password": (dict(password=5, contents={"log": b""}), RRQ, 4, b"log", 0x800A),
    "only in BOOT": (dict(bootstrap_only=("log",)), WRQ, 0, b"log", 0x8008),
    "firmware only in BOOT": (dict(firmware=DeviceFirmware()), WRQ, 0, b"app.efw", 0x8008),
    "data without a request": (dict(), DATA, 1, b"", 0x8004),
    "acknowledgement without a request": (dict(), ACK, 1, b"", 0x8004),
    "unknown op-code": (dict(), 9, 1, b"", 0x8004),
}


@pytest.mark.parametrize(
    ("options", "code", "number", "rest", "error"), REFUSED.values(), ids=REFUSED.keys()
)
def test_refusals(
    options: dict[str, object], code: int, number: int, rest: bytes, error: int
) -> None:
    answer = in_pre_op(**options).ask(code, number, rest)
    assert answer[:2] == (ERR, error)
    assert answer[2]
    assert in_pre_op(**options, error_texts=False).ask(code, number, rest) == (ERR, error, b"")


def test_the_right_password_is_accepted() -> None:
    made = in_pre_op(password=5, contents={"log": b"abc"})
    assert made.ask(RRQ, 5, b"log") == (DATA, 1, b"abc")


@pytest.mark.parametrize("packet", [0, 2, 65537])
def test_a_wrong_packet_number_ends_a_write(packet: int) -> None:
    made = in_pre_op()
    made.ask(WRQ, 0, b"a")
    assert made.ask(DATA, packet, b"x")[:2] == (ERR, 0x8005)
    assert made.ask(DATA, 1, b"x")[:2] == (ERR, 0x8004)


def test_a_wrong_acknowledgement_ends_a_read() -> None:
    made = in_pre_op(contents={"a": bytes(3 * ROOM)})
    made.ask(RRQ, 0, b"a")
    assert made.ask(ACK, 2)[:2] == (ERR, 0x8005)


def test_a_full_memory_ends_a_write() -> None:
    made = in_pre_op(contents={"other": bytes(50)}, size_limit=50 + ROOM + 10)
    assert made.write(b"a", bytes(ROOM + 11), ROOM)[:2] == (ERR, 0x8003)
    assert made.write(b"a", bytes(ROOM + 10), ROOM)[0] == ACK
    assert made.write(b"a", bytes(ROOM + 10), ROOM)[0] == ACK  # it replaces itself


def test_a_busy_device_answers_when_the_message_is_repeated() -> None:
    made = in_pre_op(busy=2)
    assert made.ask(WRQ, 0, b"a") == (BUSY, 0 | 2 << 16, b"busy")
    assert made.ask(WRQ, 0, b"a") == (BUSY, 1 | 2 << 16, b"busy")
    assert made.ask(WRQ, 0, b"a") == (ACK, 0, b"")
    assert made.ask(DATA, 1, b"x")[0] == BUSY
    assert made.ask(DATA, 1, b"x")[0] == BUSY
    assert made.ask(DATA, 1, b"x") == (ACK, 1, b"")
    assert made.device.store.files == {"a": b"x"}


def test_a_busy_read_is_continued_with_acknowledgement_0() -> None:
    made = in_pre_op(busy=2, contents={"log": b"abc"})
    assert made.ask(RRQ, 0, b"log")[0] == BUSY
    assert made.ask(ACK, 0)[0] == BUSY
    assert made.ask(ACK, 0) == (DATA, 1, b"abc")


def test_a_second_read_request_after_busy_is_illegal() -> None:
    made = in_pre_op(busy=2, contents={"log": b"abc"})
    assert made.ask(RRQ, 0, b"log")[0] == BUSY
    assert made.ask(RRQ, 0, b"log")[:2] == (ERR, 0x8004)
    assert made.ask(RRQ, 0, b"log")[0] == BUSY
    assert made.ask(BUSY, 0)[:2] == (ERR, 0x8004)  # no packet was sent yet


def test_a_busy_read_is_continued_with_the_request() -> None:
    made = in_pre_op(busy=1, contents={"log": b"abc"}, after_busy="request")
    assert made.ask(RRQ, 0, b"log")[0] == BUSY
    assert made.ask(RRQ, 0, b"log") == (DATA, 1, b"abc")
    made.send(ACK, 1)
    assert made.silent()
    assert made.ask(RRQ, 0, b"log")[0] == BUSY
    assert made.ask(ACK, 0)[:2] == (ERR, 0x8004)


def test_a_busy_device_refuses_a_file_that_it_does_not_have() -> None:
    assert in_pre_op(busy=1).ask(RRQ, 0, b"log")[:2] == (ERR, 0x8001)


def test_an_error_of_the_client_ends_a_transfer() -> None:
    made = in_pre_op()
    made.ask(WRQ, 0, b"a")
    made.send(ERR, 0x8000)
    assert made.silent()
    assert made.ask(DATA, 1, b"x")[:2] == (ERR, 0x8004)


def test_a_request_during_a_transfer() -> None:
    made = in_pre_op()
    made.ask(WRQ, 0, b"a")
    assert made.ask(WRQ, 0, b"b") == (ACK, 0, b"")
    soes = in_pre_op(second_request="refused")
    soes.ask(WRQ, 0, b"a")
    assert soes.ask(WRQ, 0, b"b")[:2] == (ERR, 0x8004)
    assert soes.ask(WRQ, 0, b"b") == (ACK, 0, b"")


def test_a_short_message_is_a_mailbox_error() -> None:
    made = in_pre_op()
    made.main.put(STATION, b"\x04\x00\x00", kind=FOE)
    answer = made.main.fetch(STATION)
    assert answer is not None
    assert (answer[5] & 0x0F, answer[6:]) == (0, struct.pack("<HH", 1, 6))


def test_a_device_without_files_does_not_support_foe() -> None:
    made = Client(AnalogInputs())
    made.start()
    made.main.put(STATION, struct.pack("<BxI", RRQ, 0) + b"a", kind=FOE)
    answer = made.main.fetch(STATION)
    assert answer is not None
    assert (answer[5] & 0x0F, answer[6:]) == (0, struct.pack("<HH", 1, 2))


def test_files_survive_a_loss_of_power() -> None:
    made = in_pre_op()
    made.write(b"a", b"abc", ROOM)
    made.device.power_off()
    made.device.power_on()
    made.main.number_stations()
    made.start()
    assert made.ask(RRQ, 0, b"a") == (DATA, 1, b"abc")


# -- BOOT ----------------------------------------------------------------------------------------


def test_boot_is_entered_from_init_and_left_for_init() -> None:
    made = client(DeviceFiles())
    made.start()
    assert made.main.request(STATION, BOOT) == (PRE_OP | ERROR, 0x0011)
    made.main.request(STATION, INIT)
    made.start(BOOT)
    for state in (PRE_OP, SAFE_OP, OP):
        assert made.main.request(STATION, state | ACKNOWLEDGE) == (BOOT | ERROR, 0x0011)
    assert made.main.request(STATION, BOOT | ACKNOWLEDGE) == (BOOT, 0)
    assert made.main.request(STATION, INIT) == (INIT, 0)
    made.start()


@pytest.mark.parametrize("size", [128, 254])
def test_boot_requires_the_bootstrap_mailbox(size: int) -> None:
    made = client(DeviceFiles())
    assert made.configure(size, BOOT) == (INIT | ERROR, 0x0015)


def test_pre_op_refuses_the_bootstrap_mailbox() -> None:
    made = client(DeviceFiles())
    assert made.configure(256, PRE_OP) == (INIT | ERROR, 0x0016)


def test_the_bootstrap_mailbox_is_that_of_the_device_by_default() -> None:
    made = Client(AnalogInputs(mailbox_bytes=200, files=DeviceFiles()))
    assert made.configure(200, BOOT) == (BOOT, 0)


def test_a_device_without_bootstrap_mailbox_refuses_boot() -> None:
    made = client(DeviceFiles(bootstrap_bytes=0))
    assert made.configure(256, BOOT) == (INIT | ERROR, 0x0013)


def test_boot_has_only_foe_and_only_its_files() -> None:
    made = client(
        DeviceFiles(contents={"log": b"abc", "boot.cfg": b"x"}, bootstrap_only=("boot.cfg",))
    )
    made.start(BOOT)
    made.main.put(STATION, struct.pack("<HBHB4x", 2 << 12, 0x40, 0x1000, 0), size=256)
    answer = made.main.fetch(STATION, 256)
    assert answer is not None
    assert (answer[5] & 0x0F, answer[6:]) == (0, struct.pack("<HH", 1, 2))
    assert made.ask(RRQ, 0, b"log")[:2] == (ERR, 0x8009)
    assert made.ask(RRQ, 0, b"boot.cfg") == (DATA, 1, b"x")


# -- Firmware ------------------------------------------------------------------------------------


def updated(image: bytes, **options: object) -> Client:
    made = client(DeviceFiles(firmware=DeviceFirmware(**options)))  # type: ignore[arg-type]
    made.start(BOOT)
    assert made.write(b"app.efw", image, BOOT_ROOM) == (ACK, len(image) // BOOT_ROOM + 1, b"")
    return made


def test_a_new_firmware_starts_after_boot() -> None:
    made = updated(make_firmware(PRODUCT, "2.1", revision=7))
    old = made.object(0x1018, 3)
    assert made.object(0x100A) == b"1.0"
    assert made.main.request(STATION, INIT) == (INIT, 0)
    assert made.object(0x100A) == b"2.1"
    assert made.object(0x1018, 3) == struct.pack("<I", 7) != old
    made.start()


def test_an_image_without_revision_keeps_it() -> None:
    made = updated(make_firmware(PRODUCT, "2.1"))
    old = made.object(0x1018, 3)
    made.main.request(STATION, INIT)
    assert (made.object(0x100A), made.object(0x1018, 3)) == (b"2.1", old)


def test_a_device_may_restart_with_a_power_cycle() -> None:
    made = updated(make_firmware(PRODUCT, "2.1"), restart="power")
    made.main.write(STATION, 0x0120, struct.pack("<H", INIT))
    made.main.let_pass(10)
    assert made.device.state == 0
    made.main.let_pass(30)
    assert made.device.state == INIT
    assert made.object(0x100A) == b"2.1"


INVALID = {
    "no header": (b"something", 0x8010),
    "damaged": (make_firmware(PRODUCT, "2.0")[:-1] + b"?", 0x800C),
    "cut off": (make_firmware(PRODUCT, "2.0")[:-5], 0x800C),
    "another product": (make_firmware(PRODUCT + 1, "2.0"), 0x800D),
}


@pytest.mark.parametrize(("image", "error"), INVALID.values(), ids=INVALID.keys())
def test_an_invalid_image_leaves_the_boot_loader(image: bytes, error: int) -> None:
    made = client(FIRMWARE)
    made.start(BOOT)
    assert made.write(b"app.efw", image, BOOT_ROOM)[:2] == (ERR, error)
    assert_only_the_boot_loader_runs(made)


def test_a_power_cut_during_the_write_leaves_the_boot_loader() -> None:
    made = client(FIRMWARE)
    made.start(BOOT)
    made.ask(WRQ, 0, b"app.efw")
    made.ask(DATA, 1, make_firmware(PRODUCT, "2.0")[:BOOT_ROOM])
    made.device.power_off()
    made.device.power_on()
    made.main.number_stations()
    assert_only_the_boot_loader_runs(made)


def assert_only_the_boot_loader_runs(made: Client) -> None:
    """Check that the device refuses PRE-OP until a valid image is written."""
    made.main.request(STATION, INIT)
    assert made.configure(128, PRE_OP) == (INIT | ERROR, 0x0014)
    made.main.request(STATION, INIT)
    made.start(BOOT)
    image = make_firmware(PRODUCT, "3.0", size=1000)
    assert made.write(b"app.efw", image, BOOT_ROOM)[0] == ACK
    made.main.request(STATION, INIT)
    made.start()
    assert made.object(0x100A) == b"3.0"


@pytest.mark.parametrize("size", [BOOT_ROOM * 10, 5000])
def test_images_of_any_size(size: int) -> None:
    image = make_firmware(PRODUCT, "2.0", size=size)
    assert len(image) == size
    made = updated(image)
    made.main.request(STATION, INIT)
    assert made.object(0x100A) == b"2.0"


@pytest.mark.parametrize(
    "make",
    [
        lambda: make_firmware(1, ""),
        lambda: make_firmware(1, "x" * 17),
        lambda: make_firmware(1, "1", size=10),
        lambda: DeviceFiles(bootstrap_bytes=33),
        lambda: DeviceFiles(password=1 << 32),
        lambda: DeviceFiles(bootstrap_bytes=0, firmware=DeviceFirmware()),
    ],
)
def test_options_out_of_range(make: object) -> None:
    with pytest.raises(ValueError, match=r"must|needs"):
        make()  # type: ignore[operator]


def test_files_of_a_segment_file(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(
        """
[[device]]
kind = "analog_inputs"

[device.files]
contents = { "log.txt" = "started" }
password = 0x1234
firmware = { name = "app.efw", version = "1.2" }
"""
    )
    [device] = read_segment(path)
    assert isinstance(device, AnalogInputs)
    assert device.store.files == {"log.txt": b"started"}
    assert device.application.dictionary.entry(0x100A, 0).read() == b"1.2"


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.binary(min_size=6, max_size=ROOM + 6),
            st.builds(
                lambda code, number, rest: struct.pack("<BxI", code, number) + rest,
                st.integers(0, 7),
                st.integers(0, 4),
                st.sampled_from((b"", b"a", b"app.efw", bytes(ROOM))),
            ),
        ),
        max_size=20,
    ),
    st.booleans(),
)
def test_any_messages_get_valid_answers(messages: list[bytes], boot: bool) -> None:
    """Let our codec judge the answers of the server to arbitrary messages."""
    contents, firmware = {"a": bytes(ROOM)}, DeviceFirmware()
    options = DeviceFiles(contents=contents, size_limit=2 * ROOM, firmware=firmware)
    store = FileStore(options, PRODUCT)
    server = FileServer(store, rooms=lambda: (ROOM, ROOM), boot=lambda: boot)
    for message in messages:
        answers = server.serve(message)
        assert len(answers) <= 1
        for answer in answers:
            assert decode_foe(answer).encode() == answer
            assert len(answer) <= ROOM + 6
    assert sum(map(len, store.files.values())) <= 2 * ROOM
