"""Faults on a segment: times, effects and the log."""

from __future__ import annotations

import struct

import pytest

from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo
from catenary.virtual.fault_player import FaultEvent
from catenary.virtual.faults import (
    Fault,
    corrupt,
    cut,
    delay,
    drift,
    drive_fault,
    duplicate,
    exchange,
    freeze,
    garble,
    join,
    late_mailbox,
    leave_state,
    lose_frames,
    mailbox_silent,
    power_cycle,
    refuse_state,
    replug,
    safe_torque_off,
    swap,
    unplug,
    wrong_working_counter,
)
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.virtual.main_device import MILLISECOND, STATION, MainDevice

BRD = encode_frame([Datagram(EcatCommand.BRD, 0x0130 << 16, bytes(2))])
UPLOAD_SERIAL = struct.pack("<HBHB4x", 2 << 12, 0x40, 0x1018, 4)


def line(*faults: Fault) -> MainDevice:
    devices = [Coupler(), DigitalOutputs(), Servo(serial=11), Servo(serial=12), DigitalOutputs()]
    return MainDevice(Segment(devices, faults=faults))


def servo(main: MainDevice, position: int = 2) -> Servo:
    device = main.segment[position]
    assert isinstance(device, Servo)
    return device


def devices(main: MainDevice) -> int | None:
    """Return the number of devices that answer, or None if the frame does not return."""
    main.link.send(BRD)
    if not main.link.wait_until(main.link.now() + MILLISECOND, True):
        return None
    frame = main.link.receive()
    assert frame is not None
    return decode_frame(frame).datagrams[0].working_counter


def counts(main: MainDevice, frames: int) -> list[int | None]:
    """Return the results of one frame per millisecond."""
    found = []
    for _ in range(frames):
        start = main.link.now()
        found.append(devices(main))
        main.link.wait_until(start // MILLISECOND * MILLISECOND + MILLISECOND, False)
    return found


def serial(main: MainDevice, station: int) -> int:
    """Bring the device to PRE-OP and read its serial number."""
    main.start_mailbox(station)
    answer = main.ask(station, UPLOAD_SERIAL)
    return int(struct.unpack_from("<I", answer, 6)[0])


# -- frames -----------------------------------------------------------------------------------


def test_frames_are_lost_from_the_start_time_on() -> None:
    main = line(lose_frames(2, at=0.003))
    assert counts(main, 8) == [5, 5, 5, None, None, 5, 5, 5]
    assert main.segment.faults_done


def test_every_third_frame_is_lost() -> None:
    main = line(lose_frames(2, at=0.002, every=3))
    assert counts(main, 8) == [5, 5, None, 5, 5, None, 5, 5]


def test_frame_lost_on_the_way_back_was_processed() -> None:
    for way, station in (("out", 0), ("back", 0x4321)):
        main = line(lose_frames(1, way=way))
        main.link.send(encode_frame([Datagram(EcatCommand.APWR, 0x0010 << 16, b"\x21\x43")]))
        assert struct.unpack("<H", main.segment.core.peek(0, 0x0010, 2)) == (station,)


def test_frames_are_lost_until_the_end_of_the_fault() -> None:
    main = line(lose_frames(at=0.002, for_=0.003))
    assert counts(main, 7) == [5, 5, None, None, None, 5, 5]


def test_corrupt_frames_are_counted_behind_the_bad_cable() -> None:
    main = line(corrupt(3, between=(1, 2)))
    assert counts(main, 4) == [None, None, None, 5]
    errors = [main.segment.core.peek(k, 0x0300, 13) for k in range(5)]
    assert [e[0] for e in errors] == [0, 0, 3, 0, 0]  # invalid frames at port 0
    assert [e[8] for e in errors] == [0, 0, 0, 3, 3]  # forwarded errors at port 0
    assert [e[9] for e in errors] == [3, 3, 3, 3, 0]  # and at port 1, on the way back
    assert [e[12] for e in errors] == [0, 0, 3, 3, 3]  # processing units


def test_corrupt_frame_has_no_effect_behind_the_bad_cable() -> None:
    main = line(corrupt(1, between=(1, 2)))
    main.link.send(encode_frame([Datagram(EcatCommand.BWR, 0x0F80 << 16, b"\x55")]))
    memory = [main.segment.core.peek(k, 0x0F80, 1) for k in range(5)]
    assert memory == [b"\x55", b"\x55", b"\0", b"\0", b"\0"]


def test_garbled_frames_return_with_wrong_bytes() -> None:
    main = line(garble(1, offset=20))
    answers = []
    for _ in range(2):
        main.link.send(BRD)
        main.link.wait_until(main.link.now() + MILLISECOND, True)
        answers.append(main.link.receive())
    broken, whole = answers
    assert broken is not None
    assert whole is not None
    assert broken[20] == whole[20] ^ 0xFF
    assert broken[:20] + broken[21:] == whole[:20] + whole[21:]


def test_delayed_frame_is_overtaken() -> None:
    main = line(delay(1, by=50e-6))
    main.link.send(BRD)
    main.link.send(encode_frame([Datagram(EcatCommand.NOP, 0, b"")]))
    commands = []
    while main.link.wait_until(main.link.now() + MILLISECOND, True):
        frame = main.link.receive()
        assert frame is not None
        commands.append(decode_frame(frame).datagrams[0].command)
    assert commands == [EcatCommand.NOP, EcatCommand.BRD]


def test_duplicated_frame_returns_twice() -> None:
    main = line(duplicate(1))
    main.link.send(BRD)
    frames = []
    while main.link.wait_until(main.link.now() + MILLISECOND, True):
        frames.append(main.link.receive())
    assert len(frames) == 2
    assert frames[0] == frames[1]


# -- cables and power -------------------------------------------------------------------------


def test_devices_behind_a_cut_do_not_answer_until_it_is_joined() -> None:
    main = line(cut(between=(2, 3), at=0.002, for_=0.003))
    # the frame at 2 ms is lost, because the controllers detect the cut 15 us later
    assert counts(main, 7) == [5, 5, None, 3, 3, 5, 5]


def test_standard_phy_detects_a_cut_after_three_milliseconds() -> None:
    segment = Segment(
        [Coupler() for _ in range(5)],
        faults=[cut(between=(2, 3), at=0.002)],
        link_loss_detection="standard",
    )
    assert counts(MainDevice(segment), 7) == [5, 5, None, None, None, 3, 3]


def test_frames_on_a_cut_cable_are_lost() -> None:
    main = line()
    main.link.send(BRD)
    main.link.wait_until(main.link.now() + 2_000, False)
    main.segment.inject(cut(between=(2, 3)))
    assert not main.link.wait_until(main.link.now() + MILLISECOND, True)
    [loss] = main.segment.take_losses()
    assert (loss.cause, loss.link) == ("in flight", 0)


def test_frame_that_has_passed_the_cable_returns() -> None:
    main = line()
    main.link.send(BRD)
    main.link.wait_until(main.link.now() + 10_200, False)  # its last byte has passed the cable
    main.segment.inject(cut(between=(3, 4)))
    assert main.link.wait_until(main.link.now() + MILLISECOND, True)


def test_cut_and_join_are_injected() -> None:
    main = line(unplug(3, at=0.001), replug(3, at=0.003), cut(between=("main", 0), at=0.005),
                join(between=(0, "main"), at=0.006))  # fmt: skip
    assert counts(main, 7) == [5, None, 3, 5, 5, None, 5]


def test_lost_link_is_counted_and_shown() -> None:
    main = line(cut(between=(2, 3), at=0.002))
    counts(main, 4)
    assert main.segment.core.peek(2, 0x0311, 1) == b"\x01"
    assert main.segment.core.peek(2, 0x0111, 1) == b"\x56"


def test_devices_behind_an_unpowered_device_do_not_answer() -> None:
    main = line(power_cycle(2, at=0.002, for_=0.004))
    assert counts(main, 8) == [5, 5, None, 2, 2, 2, 5, 5]
    assert main.segment[2].state == 1


def test_device_returns_with_its_defaults() -> None:
    main = line()
    main.number_stations()
    main.start_mailbox(STATION + 2)
    write = struct.pack("<HBHB", 2 << 12, 0x2B, 0x2102, 0) + b"\x34\x12\0\0"
    main.ask(STATION + 2, write)
    main.write(STATION + 2, 0x0F80, b"\x77")
    main.segment.inject(power_cycle(2, for_=0.01))
    assert main.segment[2].state == 0
    main.let_pass(20)
    assert main.segment.core.peek(2, 0x0010, 2) == b"\0\0"
    assert main.segment.core.peek(2, 0x0F80, 1) == b"\0"
    main.exchange(EcatCommand.APWR, -2, 0x0010, struct.pack("<H", STATION + 2))
    main.start_mailbox(STATION + 2)
    read = main.ask(STATION + 2, struct.pack("<HBHB4x", 2 << 12, 0x40, 0x2102, 0))
    assert read[6:8] == b"\0\0"


def test_power_cycle_cancels_pending_actions() -> None:
    main = line()
    main.number_stations()
    main.write(
        STATION + 2, 0x0120, b"\x02\x00"
    )  # PRE-OP without a mailbox is refused after a short time
    main.segment.inject(power_cycle(2, for_=0.0001))
    main.let_pass(5)
    assert main.segment[2].state == 1


def test_alias_in_the_eeprom_survives_a_power_cycle() -> None:
    main = line()
    main.segment[2].write_alias(0x55)
    main.segment.inject(power_cycle(2, for_=0.001))
    main.let_pass(2)
    assert main.segment.core.peek(2, 0x0012, 2) == b"\0\0"  # the register alone does not survive


def test_device_is_swapped() -> None:
    main = line(swap(2, with_=Servo(serial=99, axes=2), at=0.001, for_=0.002))
    old = main.segment[2]
    assert counts(main, 6) == [5, None, 2, 5, 5, 5]
    assert (old.position, main.segment[2].position, servo(main).axes) == (-1, 2, 2)
    main.number_stations()
    assert serial(main, STATION + 2) == 99
    Segment([old])  # it can be used in another segment


def test_two_devices_are_exchanged() -> None:
    main = line(exchange(2, 3, at=0.001, for_=0.001))
    servo(main, 2).move_to(1.25)
    assert counts(main, 4) == [5, None, 5, 5]
    assert (main.segment[2].serial, main.segment[3].serial) == (12, 11)
    assert (servo(main, 2).position_rad, servo(main, 3).position_rad) == (0.0, 1.25)
    main.number_stations()
    assert [serial(main, STATION + k) for k in (2, 3)] == [12, 11]


# -- devices ----------------------------------------------------------------------------------


def test_mailbox_silent() -> None:
    main = line()
    main.number_stations()
    main.start_mailbox(STATION + 2)
    main.segment.inject(mailbox_silent(2, for_=0.05))
    assert main.put(STATION + 2, UPLOAD_SERIAL) == 1
    assert main.fetch(STATION + 2) is None
    main.let_pass(50)
    assert main.fetch(STATION + 2) is not None


def test_late_mailbox() -> None:
    main = line(late_mailbox(2, by=0.02))
    main.number_stations()
    main.start_mailbox(STATION + 2)
    assert main.put(STATION + 2, UPLOAD_SERIAL) == 1
    assert main.fetch(STATION + 2) is None
    main.let_pass(16)
    assert main.fetch(STATION + 2) is not None


def test_state_is_refused_the_given_number_of_times() -> None:
    main = line(refuse_state(2, "PRE-OP", 0x0016, times=2))
    main.number_stations()
    main.sync_manager(STATION + 2, 0, 0x1000, 128, 0x26)
    main.sync_manager(STATION + 2, 1, 0x1080, 128, 0x22)
    answers = [main.request(STATION + 2, state) for state in (2, 0x12, 0x12)]
    assert answers == [(0x11, 0x0016), (0x11, 0x0016), (2, 0)]


def test_device_leaves_a_state() -> None:
    main = line()
    main.number_stations()
    main.start_mailbox(STATION + 2)
    main.segment.inject(leave_state(2, "INIT", 0x001A))
    assert main.al_status(STATION + 2) == (0x11, 0x001A)


def test_device_ignores_logical_datagrams() -> None:
    main = line(wrong_working_counter(2, at=0.2, for_=0.1))
    main.number_stations()
    main.let_pass(30)
    main.start_servo(STATION + 2, 0)

    def counter() -> int:
        return main.exchange_logical(EcatCommand.LRW, 0, bytes(26)).working_counter

    assert counter() == 3
    main.link.wait_until(200 * MILLISECOND, False)
    assert counter() == 0
    assert main.read(STATION + 2, 0x0130, 1) == b"\x04"  # the device still answers other datagrams
    main.link.wait_until(300 * MILLISECOND, False)
    assert counter() == 3


def test_drive_fault_sto_and_frozen_model() -> None:
    main = line(drive_fault(2, 0x3210), safe_torque_off(3), freeze(3, at=0.04))
    main.let_pass(30)
    assert servo(main, 2).drive_state() == "FAULT"
    assert servo(main, 3).drive_state() == "SWITCH ON DISABLED"
    main.let_pass(20)
    assert main.segment.fault_log[-1].fault == freeze(3, at=0.04)


def test_frozen_device_can_be_removed() -> None:
    """Found by `python -m benchmarks soak --minutes 1 --seed 24`."""
    other = Servo()
    main = line(freeze(3, at=0.01, for_=0.05), swap(3, other, at=0.02))
    main.let_pass(100)
    assert main.segment[3] is other
    assert main.segment.fault_log[-1] == FaultEvent(0.06, freeze(3, at=0.01, for_=0.05), "ends")


def test_drift_changes_the_clock_rate() -> None:
    main = line(drift(0, ppm=100.0, at=1.0, for_=1.0))
    main.number_stations()

    def ahead() -> int:
        """Return the lead of the second device's clock [ns]."""
        times = [
            struct.unpack("<Q", main.read(STATION + k, 0x0910, 8))[0] - main.link.now()
            for k in (0, 2)
        ]
        return int(times[0] - times[1])

    start = ahead()
    main.link.wait_until(1_500 * MILLISECOND, False)
    assert ahead() - start == pytest.approx(50_000, abs=200)
    main.link.wait_until(3_000 * MILLISECOND, False)
    assert ahead() - start == pytest.approx(100_000, abs=200)


# -- schedule and log -------------------------------------------------------------------------


def test_log_records_faults_with_their_times() -> None:
    off = power_cycle(2, at=0.002, for_=0.004)
    main = line(off, lose_frames(1, at=0.001))
    assert not main.segment.faults_done
    main.let_pass(10)
    assert [(e.time, e.fault.kind, e.what) for e in main.segment.fault_log] == [
        (0.001, "lose_frames", "begins"),
        (0.002, "power_cycle", "begins"),
        (0.006, "power_cycle", "ends"),
    ]
    assert main.segment.fault_log[1] == FaultEvent(0.002, off, "begins")
    assert not main.segment.faults_done  # no frame was sent, so none was lost
    devices(main)
    assert main.segment.faults_done


def test_fault_can_be_injected_at_run_time() -> None:
    main = line()
    main.let_pass(5)
    main.segment.inject(cut(between=(0, 1), at=0.007))
    main.segment.inject(lose_frames(1, at=0.001))  # the time has passed: immediately
    main.let_pass(5)
    assert [round(event.time, 6) for event in main.segment.fault_log] == [0.005, 0.007]
    assert main.segment.time == 0.010


def test_lost_frames_are_reported_with_their_cause() -> None:
    main = line(lose_frames(1, at=0.001), corrupt(1, at=0.002), cut(between=(2, 3), at=0.003))
    counts(main, 5)
    losses = main.segment.take_losses()
    assert [(round(x.time, 6), x.cause) for x in losses] == [
        (0.001, "injected"),
        (0.002, "corrupt"),
        (0.003, "no light"),
    ]
    assert main.segment.take_losses() == []


def test_fault_of_a_removed_device_misses() -> None:
    main = line(swap(2, with_=Coupler(), at=0.001), drive_fault(2, at=0.002))
    main.let_pass(5)
    assert [event.what for event in main.segment.fault_log] == ["begins", "ends", "misses"]


def test_excess_frame_faults_miss() -> None:
    main = line(*(lose_frames(at=0.001 * k, for_=1.0) for k in range(40)))
    main.let_pass(50)
    whats = [event.what for event in main.segment.fault_log]
    assert whats == ["begins"] * 32 + ["misses"] * 8
    main.let_pass(1000)
    main.segment.inject(lose_frames(1))
    assert main.segment.fault_log[-1].what == "begins"


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (power_cycle(5), "power_cycle: device: device 5 does not exist; the last one is 4"),
        (cut(between=(1, 3)), "cut: between: 1 and 3 are not neighbours"),
        (corrupt(between=(4, 5)), "between"),
        (mailbox_silent(0), r"device 0 \(coupler\) has no application"),
        (drive_fault(1), "is not a servo"),
        (drive_fault(2, axis=1), "axis"),
        (exchange(2, 2), "other"),
        (exchange(2, 9), "other: device 9 does not exist"),
    ],
)
def test_unsuitable_fault_is_refused_with_the_field(fault: Fault, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        line(fault)


def test_real_time_counts_from_the_first_frame() -> None:
    segment = Segment([Coupler()], clock="monotonic", faults=[lose_frames(1, at=0.0)])
    with segment.open_link() as link:
        link.wait_until(link.now() + 5 * MILLISECOND, False)
        assert (segment.time, segment.fault_log) == (0.0, ())
        link.send(BRD)
        deadline = link.now() + 10_000 * MILLISECOND
        while not segment.fault_log and link.now() < deadline:
            link.wait_until(link.now() + MILLISECOND, False)
        assert segment.time > 0
        while link.receive() is not None:
            pass
        link.send(BRD)
        assert not link.wait_until(link.now() + 50 * MILLISECOND, True)
        assert [loss.cause for loss in segment.take_losses()] == ["injected"]
