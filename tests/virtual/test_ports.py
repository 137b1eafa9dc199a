"""Ports: loops, links, trees, circulating frames and receive times.

ET1100 datasheet, section I, chapter 3; section II, 0x0101, 0x0110, 0x0300 to 0x0313, 0x0900.
"""

from __future__ import annotations

import struct

import pytest

from catenary.virtual import Coupler, Junction, Segment
from catenary.virtual.faults import cut, power_cycle
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.virtual.main_device import MILLISECOND, STATION, MainDevice

PROCESSED, BACK = 390, 350  # [ns] from one device to the next, with and without the processing unit
AUTO, AUTO_CLOSE, OPEN, CLOSED = range(4)
DL_CONTROL, DL_STATUS = 0x0100, 0x0110


def line(count: int = 3) -> MainDevice:
    main = MainDevice(Segment([Coupler() for _ in range(count)]))
    main.number_stations()
    return main


def tree() -> MainDevice:
    """0 ─ 1 ┬ port 3: 2 ─ 3
    ├ port 1: 4
    └ port 2: 5"""
    devices = [Coupler(), Junction(), Coupler(), Coupler(), Coupler(), Coupler()]
    behind = {2: (1, 3), 4: (1, 1), 5: (1, 2)}
    main = MainDevice(Segment(devices, behind=behind))
    main.number_stations()
    return main


def answers(main: MainDevice) -> int | None:
    main.link.send(encode_frame([Datagram(EcatCommand.BRD, 0, b"\0")]))
    if not main.link.wait_until(main.link.now() + MILLISECOND, True):
        return None
    frame = main.link.receive()
    assert frame is not None
    return decode_frame(frame).datagrams[0].working_counter


def loops(main: MainDevice, device: int) -> tuple[int, int]:
    """Return (links, loops) from DL status."""
    status = main.segment.core.peek(device, DL_STATUS, 2)
    return status[0] >> 4, status[1]


def times(main: MainDevice, device: int) -> list[int]:
    return list(struct.unpack("<4I", main.read(STATION + device, 0x0900, 16)))


# -- trees ------------------------------------------------------------------------------------


def test_positions_follow_the_frame_path() -> None:
    main = tree()
    assert main.segment.wires.processed(0) == [0, 1, 2, 3, 4, 5]
    assert [main.read(STATION + k, 0x0010, 2) for k in range(6)] == [
        struct.pack("<H", STATION + k) for k in range(6)
    ]


def test_dl_status_shows_connected_ports() -> None:
    main = tree()
    assert loops(main, 1) == (0b1111, 0b10101010)
    assert loops(main, 3) == (0b0001, 0b01010110)
    assert main.segment.core.peek(1, 0x0007, 1) == b"\xff"  # four ports
    assert main.segment.core.peek(0, 0x0007, 1) == b"\x0f"


def test_cut_branch_does_not_affect_the_others() -> None:
    main = tree()
    main.segment.inject(cut(between=(1, 2)))
    assert answers(main) is None  # not detected yet
    assert answers(main) == 4
    assert main.segment.wires.processed(0) == [0, 1, 4, 5]
    assert loops(main, 1) == (0b0111, 0b01101010)


def test_frames_return_to_each_port_after_its_branch() -> None:
    main = tree()
    main.exchange(EcatCommand.BWR, 0, 0x0900, bytes(4))
    at = times(main, 1)
    # port 3: two devices, both processed, one turns, one forwards; then port 1, then port 2
    assert at[3] - at[0] == PROCESSED + PROCESSED + PROCESSED + BACK
    assert at[1] - at[3] == BACK + PROCESSED
    assert at[2] - at[1] == BACK + PROCESSED


def test_port_without_frames_keeps_its_receive_time() -> None:
    main = tree()
    main.exchange(EcatCommand.BWR, 0, 0x0900, bytes(4))
    assert times(main, 5)[1:] == [0, 0, 0]


def test_longer_cable_adds_delay() -> None:
    main = line(2)
    main.exchange(EcatCommand.BWR, 0, 0x0900, bytes(4))
    short = times(main, 0)
    main.segment.wires.delay_cable(1, 550)
    main.exchange(EcatCommand.BWR, 0, 0x0900, bytes(4))
    long = times(main, 0)
    assert (long[1] - long[0]) - (short[1] - short[0]) == 2 * 500


# -- loop control -----------------------------------------------------------------------------


def test_manually_closed_loop_ends_the_line() -> None:
    main = line()
    main.write(STATION + 1, DL_CONTROL + 1, bytes([CLOSED << 2]))
    assert answers(main) == 2
    assert loops(main, 1) == (0b0011, 0b01010110)  # the link exists, but the loop is closed
    assert loops(main, 2) == (0b0001, 0b01010110)
    main.write(STATION + 1, DL_CONTROL + 1, bytes([AUTO]))
    assert answers(main) == 3


def test_manually_opened_loop_loses_frames() -> None:
    main = line()
    main.write(STATION + 2, DL_CONTROL + 1, bytes([OPEN << 2]))
    assert answers(main) is None
    assert [loss.cause for loss in main.segment.take_losses()] == ["no light"]


def test_missing_port_stays_closed() -> None:
    main = line()
    main.write(STATION, DL_CONTROL + 1, bytes([OPEN << 6 | OPEN << 4]))
    assert answers(main) == 3


def test_temporary_use_lasts_a_second() -> None:
    main = line()
    main.write(STATION + 1, DL_CONTROL, bytes([0x03, CLOSED << 2]))
    assert answers(main) == 2
    main.let_pass(990)
    assert answers(main) == 2
    main.let_pass(20)
    assert answers(main) == 3
    assert main.read(STATION + 1, DL_CONTROL, 2) == b"\x01\x00"


def test_auto_close_opens_when_written_again() -> None:
    main = line()
    main.write(STATION, DL_CONTROL + 1, bytes([AUTO_CLOSE << 2]))
    main.segment.inject(cut(between=(0, 1), for_=0.01))
    main.let_pass(20)
    assert answers(main) == 1  # joined, but closed until DL control is written
    main.write(STATION, DL_CONTROL + 1, bytes([AUTO_CLOSE << 2]))
    assert answers(main) == 3


def test_auto_close_opens_when_a_frame_arrives() -> None:
    segment = Segment([Coupler(), Coupler()], ring=True)
    with segment.open_link() as link, segment.second.open_link() as other:
        control = Datagram(EcatCommand.APWR, (DL_CONTROL + 1) << 16, bytes([AUTO_CLOSE << 2]))
        link.send(encode_frame([control]))
        segment.inject(cut(between=(0, 1), for_=0.01))
        link.wait_until(20 * MILLISECOND, False)
        segment.take_losses()
        assert segment.wires.processed(0) == [0]
        other.send(encode_frame([Datagram(EcatCommand.BRD, 0, b"\0")]))
        assert not other.wait_until(
            other.now() + MILLISECOND, True
        )  # the frame that opened the loop
    assert [loss.cause for loss in segment.take_losses()] == ["closed port"]
    assert segment.wires.processed(0) == [0, 1]


# -- links ------------------------------------------------------------------------------------


def test_lost_links_are_counted_and_cleared_by_writing() -> None:
    main = line()
    for _ in range(3):
        main.segment.inject(cut(between=(0, 1), for_=0.001))
        main.let_pass(2)
    assert main.read(STATION, 0x0310, 4) == b"\0\x03\0\0"
    assert main.read(STATION + 1, 0x0310, 4) == b"\x03\0\0\0"
    main.write(STATION, 0x0312, b"\0")
    assert main.read(STATION, 0x0310, 4) == b"\0\0\0\0"


def test_short_loss_of_light_is_not_detected() -> None:
    main = line()
    main.segment.inject(cut(between=(0, 1), for_=10e-6))  # enhanced detection takes 15 us
    main.let_pass(1)
    assert main.read(STATION, 0x0310, 4) == bytes(4)
    assert answers(main) == 3


def test_link_change_raises_an_event() -> None:
    main = line()
    main.read(STATION, DL_STATUS, 2)
    assert main.segment.core.peek(0, 0x0210, 1)[0] & 4 == 0
    main.segment.inject(power_cycle(1, for_=0.001))
    main.let_pass(0.5)
    assert main.segment.core.peek(0, 0x0210, 1)[0] & 4 == 4


def test_malformed_frame_is_counted_by_every_processing_unit() -> None:
    main = line()
    frame = bytearray(encode_frame([Datagram(EcatCommand.BRD, 0, bytes(20))]))
    frame[16 + 6] = 200  # the datagram is longer than the frame
    main.link.send(bytes(frame))
    assert [main.segment.core.peek(k, 0x030C, 1) for k in range(3)] == [b"\x01"] * 3
    assert main.segment.frames.malformed == 1


@pytest.mark.parametrize("seconds", [-1.0, 2.0, "slow"])
def test_invalid_detection_time_is_refused(seconds: float | str) -> None:
    with pytest.raises(ValueError, match="link_loss_detection"):
        Segment([Coupler()], link_loss_detection=seconds)  # type: ignore[arg-type]
