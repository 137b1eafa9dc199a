"""CoE server: transfers, aborts, complete access, SDO information and emergencies."""

from __future__ import annotations

import struct

import pytest

from catenary.virtual import AnalogInputs, Segment, Servo
from tests.virtual.main_device import STATION, MainDevice


@pytest.fixture
def main() -> MainDevice:
    main = MainDevice(Segment([Servo(name="shoulder"), AnalogInputs()]))
    main.number_stations()
    main.start_mailbox(STATION)
    main.start_mailbox(STATION + 1)
    return main


def test_expedited_normal_and_segmented_uploads(main: MainDevice) -> None:
    assert main.upload(STATION, 0x1018, 1) == b"YNTC"
    assert main.upload(STATION, 0x6061, 0) == b"\x00"
    assert main.upload(STATION, 0x1008, 0) == b"shoulder"
    assert main.upload(STATION, 0x2100, 0) == bytes(k * 7 & 0xFF for k in range(2048))


@pytest.mark.parametrize("size", [32, 64, 250, 1024])
def test_mailboxes_of_any_size(size: int) -> None:
    main = MainDevice(Segment([Servo(mailbox_bytes=size)]))
    main.number_stations()
    main.start_mailbox(STATION, size)
    assert main.upload(STATION, 0x2100, 0, size) == bytes(k * 7 & 0xFF for k in range(2048))


def test_segmented_download(main: MainDevice) -> None:
    data = bytes(range(256)) * 5
    head = struct.pack("<BHBI", 0x21, 0x2101, 0, len(data))
    assert main.sdo(STATION, head + data[:112])[0] == 0x60
    rest, toggle = data[112:], 0
    while rest:
        part, rest = rest[:119], rest[119:]
        unused = max(7 - len(part), 0)
        command = toggle | unused << 1 | (not rest)
        assert main.sdo(STATION, bytes([command]) + part.ljust(7, b"\0"))[0] == 0x20 | toggle
        toggle ^= 0x10
    assert main.upload(STATION, 0x2101, 0) == data


@pytest.mark.parametrize(
    ("index", "subindex", "code"),
    [(0x5000, 0, 0x06020000), (0x1018, 9, 0x06090011)],
)
def test_upload_aborts(main: MainDevice, index: int, subindex: int, code: int) -> None:
    assert main.upload(STATION, index, subindex) == code


@pytest.mark.parametrize(
    ("index", "subindex", "data", "code"),
    [
        (0x1018, 1, bytes(4), 0x06010002),
        (0x6065, 0, bytes(2), 0x06070013),
        (0x6060, 0, bytes(4), 0x06070012),
        (0x6060, 0, b"\x04", 0x06090030),
        (0x2101, 0, bytes(2049), 0x06070012),
    ],
)
def test_download_aborts(
    main: MainDevice, index: int, subindex: int, data: bytes, code: int
) -> None:
    if len(data) > 100:
        head = struct.pack("<BHBI", 0x21, index, subindex, len(data))
        main.sdo(STATION, head + data[:112])
        rest, toggle, answer = data[112:], 0, b""
        while rest:
            part, rest = rest[:119], rest[119:]
            answer = main.sdo(STATION, bytes([toggle | (not rest)]) + part.ljust(7, b"\0"))
            toggle ^= 0x10
        assert struct.unpack_from("<I", answer, 4)[0] == code
    else:
        assert main.download(STATION, index, subindex, data) == code


def test_wrong_toggle_and_unexpected_segment_abort(main: MainDevice) -> None:
    main.sdo(STATION, struct.pack("<BHB4x", 0x40, 0x2100, 0))
    answer = main.sdo(STATION, struct.pack("<B7x", 0x70))
    assert struct.unpack("<BHBI", answer) == (0x80, 0x2100, 0, 0x05030000)
    answer = main.sdo(STATION, struct.pack("<B7x", 0x60))
    assert struct.unpack_from("<I", answer, 4)[0] == 0x05040001


def test_complete_access_reads_and_writes_records(main: MainDevice) -> None:
    answer = main.sdo(STATION, struct.pack("<BHB4x", 0x50, 0x1018, 0))
    assert struct.unpack_from("<I", answer, 4)[0] == 18
    assert answer[8:14] == b"\x04\x00YNTC"
    limits = struct.pack("<BxII", 2, 100, 200)
    head = struct.pack("<BHBI", 0x31, 0x607D, 0, len(limits))
    assert main.sdo(STATION, head + limits)[0] == 0x60
    assert main.upload(STATION, 0x607D, 2) == struct.pack("<I", 200)


def test_default_process_data(main: MainDevice) -> None:
    rx = [main.upload(STATION, 0x1600, k) for k in range(6)]
    tx = [main.upload(STATION, 0x1A00, k) for k in range(6)]
    packed = [
        struct.pack("<I", v) for v in (0x60400010, 0x60600008, 0x60FF0020, 0x607A0020, 0x60710010)
    ]
    assert rx == [b"\x05", *packed]
    packed = [
        struct.pack("<I", v) for v in (0x60410010, 0x60610008, 0x606C0020, 0x60640020, 0x60770010)
    ]
    assert tx == [b"\x05", *packed]
    assert main.upload(STATION, 0x1C12, 1) == b"\x00\x16"
    assert main.upload(STATION, 0x1C13, 1) == b"\x00\x1a"


def test_mapping_is_written_with_the_count_first_and_last(main: MainDevice) -> None:
    entry = struct.pack("<I", 0x607A0020)
    assert main.download(STATION, 0x1600, 1, entry) == 0x06010003
    assert main.download(STATION, 0x1600, 0, b"\x00") == 0
    assert main.download(STATION, 0x1600, 1, entry) == 0
    assert main.download(STATION, 0x1600, 2, struct.pack("<I", 0x60410010)) == 0x06040041
    assert main.download(STATION, 0x1600, 2, struct.pack("<I", 0x60400008)) == 0x06040041
    assert main.download(STATION, 0x1600, 2, struct.pack("<I", 0x60400010)) == 0
    assert main.download(STATION, 0x1600, 0, b"\x02") == 0
    assert main.download(STATION, 0x1600, 0, b"\x30") == 0x06040042


def test_changed_mapping_changes_the_expected_length(main: MainDevice) -> None:
    main.download(STATION, 0x1C12, 0, b"\x00")
    assert main.download(STATION, 0x1C12, 1, b"\x00\x17") == 0x06040041
    assert main.download(STATION, 0x1C12, 1, b"\x01\x16") == 0
    assert main.download(STATION, 0x1C12, 0, b"\x01") == 0
    main.sync_manager(STATION, 2, 0x1100, 6, 0x64)
    main.sync_manager(STATION, 3, 0x2000, 13, 0x20)
    assert main.request(STATION, 4) == (4, 0)
    assert main.download(STATION, 0x1C12, 0, b"\x00") == 0x08000022


def test_information_lists_and_describes_the_objects(main: MainDevice) -> None:
    main.put(STATION, struct.pack("<HBBHH", 0x8000, 1, 0, 0, 1))
    indices = b""
    while (answer := main.fetch(STATION)) is not None:
        assert answer[6:8] == b"\x00\x80"
        indices += answer[12:]
        if not answer[8] & 0x80:
            break
    found = struct.unpack(f"<{len(indices) // 2}H", indices)
    assert found[0] == 1
    assert {0x1000, 0x1C12, 0x6040, 0x60FF} <= set(found[1:])
    answer = main.ask(STATION, struct.pack("<HBBHH", 0x8000, 3, 0, 0, 0x6040))
    assert answer[6:] == struct.pack("<HHBB", 0x6040, 6, 0, 7) + b"Controlword"
    answer = main.ask(STATION, struct.pack("<HBBHHBB", 0x8000, 5, 0, 0, 0x1018, 1, 0))
    assert answer[6:] == struct.pack("<HBBHHH", 0x1018, 1, 0, 7, 32, 7) + b"Vendor ID"
    answer = main.ask(STATION, struct.pack("<HBBHH", 0x8000, 3, 0, 0, 0x5000))
    assert answer[2] == 7


def test_unsupported_protocol_gets_a_mailbox_error(main: MainDevice) -> None:
    main.put(STATION, bytes(8), kind=4)
    answer = main.fetch(STATION)
    assert answer is not None
    assert answer[5] & 0x0F == 0
    assert answer[6:] == b"\x01\x00\x02\x00"


def test_answer_counter_runs_from_one_to_seven(main: MainDevice) -> None:
    counters = []
    for _ in range(9):
        main.put(STATION, struct.pack("<HBHB4x", 0x2000, 0x40, 0x1018, 1))
        answer = main.fetch(STATION)
        assert answer is not None
        counters.append(answer[5] >> 4)
    assert counters == [1, 2, 3, 4, 5, 6, 7, 1, 2]


def test_fault_sends_an_emergency(main: MainDevice) -> None:
    servo = main.segment[0]
    assert isinstance(servo, Servo)
    servo.inject_fault(0x2310)
    answer = main.fetch(STATION)
    assert answer is not None
    assert answer[6:] == struct.pack("<HHB5x", 0x1000, 0x2310, 1)
    assert main.upload(STATION, 0x603F, 0) == struct.pack("<H", 0x2310)
    assert main.upload(STATION, 0x1001, 0) == b"\x01"


def test_silent_mailbox_stays_full(main: MainDevice) -> None:
    servo = main.segment[0]
    assert isinstance(servo, Servo)
    servo.mailbox_silent = True
    assert main.put(STATION, struct.pack("<HBHB4x", 0x2000, 0x40, 0x1018, 1)) == 1
    assert main.fetch(STATION) is None
    assert main.put(STATION, bytes(10)) == 0
    servo.mailbox_silent = False
    assert main.fetch(STATION) is not None


def test_analogue_value_and_its_status_bits(main: MainDevice) -> None:
    terminal = main.segment[1]
    assert isinstance(terminal, AnalogInputs)
    terminal.apply_volts(1, 5.0)
    assert main.upload(STATION + 1, 0x6010, 0x11) == struct.pack("<h", 16384)
    terminal.apply_volts(1, 11.0)
    assert main.upload(STATION + 1, 0x6010, 0x02) == b"\x01"
    assert terminal.volts(1) == 10.0
