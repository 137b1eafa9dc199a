"""Servo synchronised to SYNC0: output and input times, counters and errors.

0x1C32, 0x1C33: ETG.1020 §5.2.1. AL status codes: ETG.1000.6 table 11."""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest

from catenary.virtual import Coupler, Crystal, Segment, Servo, ServoQuirks
from catenary.virtual.faults import power_cycle
from catenary.virtual.op_modes import EASYCAT, EASYCAT_STORED, EL3702, SYNC1_ALONE, OpMode
from catenary.wire.datagram import EcatCommand
from catenary.wire.sii import decode_sii
from tests.virtual.clocks import ACTIVATION, START_TIME, SYNC0_CYCLE, SYNC1_CYCLE, Clocks
from tests.virtual.main_device import STATION

MS = 1_000_000
DEVICE = 1
SERVO = STATION + DEVICE
LOGICAL = 0x10000
SYNCHRONISATION_ERROR, FATAL_SYNC_ERROR, NO_SYNC_ERROR = 0x1A, 0x2C, 0x2D
INVALID_DC, DC_CYCLE, DC_SYNC0_CYCLE = 0x30, 0x35, 0x36
OUTPUTS = struct.Struct("<Hbiih")
CSV = 9


class Drive(Clocks):
    """Line with one servo, and the phase of its SYNC unit."""

    def __init__(self, servo: Servo | None = None) -> None:
        super().__init__(Segment([Coupler(), servo or Servo()]))
        self.first = 0  # system time of the first pulse
        self.cycle = MS
        self.targets = OUTPUTS.pack(0, CSV, 0, 0, 0)

    @property
    def servo(self) -> Servo:
        device = self.segment[DEVICE]
        assert isinstance(device, Servo)
        return device

    def switch_on(self, cycle: int = MS, ahead: int = 20 * MS, activation: int = 0x03) -> None:
        self.cycle, self.first = cycle, self.system_time(DEVICE) + ahead
        self.put_number(DEVICE, START_TIME, "<Q", self.first)
        self.put_number(DEVICE, SYNC0_CYCLE, "<I", cycle)
        self.put_number(DEVICE, ACTIVATION, "<B", activation)

    def until(self, phase: float) -> None:
        """Wait for the next time `phase` [us] after an actual or expected pulse."""
        now = self.core_time() - self.first
        wait = (round(phase * 1e3) - now) % self.cycle
        self.link.wait_until(self.link.now() + wait, False)

    def core_time(self) -> int:
        """Return the system time of the device without a frame; its crystal is exact."""
        return self.link.now() + self._apart

    def operational(self, cycle: int = MS) -> None:
        self.start_mailbox(SERVO)
        self.operational_after_mailbox(cycle)

    def operational_after_mailbox(self, cycle: int = MS) -> None:
        self.switch_on(cycle)
        before = self.link.now()
        self._apart = self.system_time(DEVICE) - before - 600  # arrival time of the frame
        assert self.safe_op() == (4, 0)
        self.write(SERVO, 0x0120, struct.pack("<H", 8))
        self.cycles(40 * MS // cycle)
        assert self.al_status(SERVO) == (8, 0)

    def safe_op(self) -> tuple[int, int]:
        self.sync_manager(SERVO, 2, 0x1100, 13, 0x64)
        self.sync_manager(SERVO, 3, 0x2000, 13, 0x20)
        self.fmmu(SERVO, 0, LOGICAL, (13, 0, 7), 0x1100, 2)
        self.fmmu(SERVO, 1, LOGICAL + 13, (13, 0, 7), 0x2000, 1)
        return self.request(SERVO, 4)

    def swap(self) -> tuple[int, int, int, int, int]:
        """Exchange process data."""
        answer = self.exchange_logical(EcatCommand.LRW, LOGICAL, self.targets + bytes(13))
        assert answer.working_counter == 3
        return OUTPUTS.unpack(answer.data[13:])

    def cycles(self, count: int, phase: float = 500.0) -> None:
        for _ in range(count):
            self.until(phase)
            self.swap()

    def enable(self) -> None:
        for word in (6, 7, 15):
            self.targets = OUTPUTS.pack(word, CSV, 0, 0, 0)
            self.cycles(3)
        assert self.servo.drive_state() == "OPERATION ENABLED"


@pytest.fixture
def drive() -> Drive:
    return Drive()


def value(drive: Drive, index: int, subindex: int) -> int:
    raw = drive.upload(SERVO, index, subindex)
    assert isinstance(raw, bytes), hex(raw)
    return int.from_bytes(raw, "little")


# -- choosing the type -------------------------------------------------------------------------


def test_device_without_sync_runs_free(drive: Drive) -> None:
    drive.start_servo(SERVO, LOGICAL)
    assert value(drive, 0x1C32, 1) == 0
    assert value(drive, 0x1C32, 2) == 250_000
    assert not drive.segment.core.synchronous(DEVICE)[0]


def test_active_sync0_makes_the_device_dc_synchronous(drive: Drive) -> None:
    drive.operational(cycle=2 * MS)
    for index in (0x1C32, 0x1C33):
        assert value(drive, index, 0x01) == 2
        assert value(drive, index, 0x02) == value(drive, index, 0x0A) == 2 * MS
        assert value(drive, index, 0x04) == 0x0005  # free run, DC SYNC0
        assert value(drive, index, 0x05) == 62_500
    assert (value(drive, 0x1C32, 6), value(drive, 0x1C33, 6)) == (20_000, 0)
    assert drive.request(SERVO, 2) == (2, 0)
    assert value(drive, 0x1C32, 1) == 0


@pytest.mark.parametrize(
    ("prepare", "code"),
    [
        (
            lambda d: d.download(SERVO, 0x1C32, 1, b"\x02\0"),
            INVALID_DC,
        ),  # requested but not activated
        (lambda d: d.switch_on(activation=0x05), INVALID_DC),  # only SYNC1
        (lambda d: (d.download(SERVO, 0x1C32, 1, b"\0\0"), d.switch_on()), INVALID_DC),
        (lambda d: d.switch_on(cycle=50_000), DC_SYNC0_CYCLE),
        (lambda d: d.switch_on(cycle=0), DC_SYNC0_CYCLE),
        (
            lambda d: (d.download(SERVO, 0x1C32, 2, struct.pack("<I", MS)), d.switch_on(2 * MS)),
            DC_CYCLE,
        ),
    ],
)
def test_invalid_clock_configuration_is_refused(
    drive: Drive, prepare: Callable[[Drive], object], code: int
) -> None:
    drive.start_mailbox(SERVO)
    prepare(drive)
    assert drive.safe_op() == (0x12, code)


def test_unsupported_types_are_aborted(drive: Drive) -> None:
    drive.start_mailbox(SERVO)
    assert drive.download(SERVO, 0x1C32, 1, b"\x03\0") == 0x06090030
    assert drive.download(SERVO, 0x1C32, 1, b"\x02\0") == 0
    assert drive.download(SERVO, 0x10F1, 2, b"\0\0") == 0x06090030


def test_sii_contains_the_op_modes(drive: Drive) -> None:
    sii = decode_sii(drive.segment.core.sii_image(DEVICE))
    free, synchronous = sii.clock_modes
    assert (free.assign_activate, synchronous.assign_activate) == (0, 0x0300)
    assert (synchronous.sync0_factor, synchronous.sync1_factor) == (1, 0)


# -- operational needs pulses ------------------------------------------------------------------


def test_op_requires_pulses(drive: Drive) -> None:
    drive.start_mailbox(SERVO)
    drive.switch_on(ahead=60_000 * MS)
    assert drive.safe_op() == (4, 0)
    drive.write(SERVO, 0x0120, struct.pack("<H", 8))
    drive.swap()
    drive.let_pass(990)
    assert drive.al_status(SERVO) == (4, 0)
    drive.let_pass(20)
    assert drive.al_status(SERVO) == (0x14, NO_SYNC_ERROR)


def test_start_in_the_past_prevents_op(drive: Drive) -> None:
    drive.start_mailbox(SERVO)
    drive.switch_on(ahead=-1 * MS)
    assert drive.safe_op() == (4, 0)
    drive.write(SERVO, 0x0120, struct.pack("<H", 8))
    drive.swap()
    drive.let_pass(1_010)
    assert drive.al_status(SERVO) == (0x14, NO_SYNC_ERROR)


def test_op_waits_for_the_first_pulse(drive: Drive) -> None:
    drive.start_mailbox(SERVO)
    drive.switch_on(ahead=50 * MS)
    drive.safe_op()
    drive.write(SERVO, 0x0120, struct.pack("<H", 8))
    drive.swap()
    drive.let_pass(20)
    assert drive.al_status(SERVO) == (4, 0)
    for _ in range(30):
        drive.let_pass(0.9)
        drive.swap()
    assert drive.al_status(SERVO) == (8, 0)


# -- pulses step it ----------------------------------------------------------------------------


def test_outputs_are_accepted_at_the_pulse(drive: Drive) -> None:
    drive.operational()
    drive.enable()
    drive.targets = OUTPUTS.pack(15, CSV, 1 << 20, 0, 0)
    drive.until(300)
    drive.swap()
    drive.until(990)
    assert drive.servo.torque_nm == 0
    drive.until(10)
    assert drive.servo.torque_nm > 0


def test_inputs_are_latched_at_the_pulse(drive: Drive) -> None:
    drive.operational()
    drive.until(100)
    before = drive.swap()[3]
    drive.servo.move_to(1.0)
    drive.until(900)
    drive.targets = OUTPUTS.pack(0, CSV, 0, 0, 0)
    assert drive.swap()[3] == before
    drive.until(300)
    assert drive.swap()[3] == pytest.approx(2**20 / 6.2832, abs=20)


@pytest.mark.parametrize("cycle", [125_000, 250_000, 1_000_000, 4_000_000])
def test_internal_steps_add_up_to_the_elapsed_time(cycle: int) -> None:
    """The internal cycle divides that of SYNC0. A frictionless motor shows the elapsed time."""
    drive = Drive(Servo(viscous_friction=0, coulomb_friction=0))
    drive.operational(cycle=cycle)
    start, speed = drive.servo.position_rad, drive.servo.velocity_rad_s
    assert speed == 0
    drive.servo.apply_load(1e-3)  # N m on 5e-4 kg m2: 2 rad/s2
    drive.until(0)
    began = drive.link.now()
    speed = drive.servo.velocity_rad_s
    drive.cycles(100_000_000 // cycle, phase=cycle / 2e3)
    elapsed = (drive.link.now() - began) * 1e-9
    acceleration = (drive.servo.velocity_rad_s - speed) / elapsed
    assert start < drive.servo.position_rad
    assert acceleration == pytest.approx(2.0, rel=0.02)


# -- missed ------------------------------------------------------------------------------------


def test_two_missed_pulses_cause_no_fault(drive: Drive) -> None:
    drive.operational()
    drive.enable()
    drive.until(500)
    drive.swap()
    drive.let_pass(2.9)  # three pulses, the first with new outputs
    assert drive.segment.core.synchronous(DEVICE)[2:] == (2, 0, 0, True)
    drive.cycles(5)
    assert drive.al_status(SERVO) == (8, 0)
    assert drive.servo.drive_state() == "OPERATION ENABLED"
    assert drive.segment.core.synchronous(DEVICE)[2:] == (2, 0, 0, False)


def test_three_consecutive_missed_pulses_cause_a_fault(drive: Drive) -> None:
    drive.operational()
    drive.enable()
    drive.until(500)
    drive.swap()
    drive.let_pass(3.6)
    assert drive.al_status(SERVO) == (0x14, SYNCHRONISATION_ERROR)
    assert drive.servo.drive_state() in ("FAULT", "FAULT REACTION ACTIVE")
    message = drive.fetch(SERVO)
    assert message is not None
    assert struct.unpack_from("<HH", message, 6) == (0x1000, 0x8700)  # an emergency
    assert value(drive, 0x603F, 0) == 0x8700
    assert value(drive, 0x1C32, 0x0B) >= 3


def test_the_limit_can_be_set_in_python_and_by_sdo() -> None:
    assert value_of_limit(Drive(Servo(sync_missed_limit=10))) == 10
    drive = Drive()
    drive.start_mailbox(SERVO)
    assert drive.download(SERVO, 0x10F1, 2, b"\x06\0") == 0
    assert value(drive, 0x10F1, 2) == 6
    drive.operational_after_mailbox()
    drive.until(500)
    drive.swap()
    drive.let_pass(5.8)  # the first pulse has new outputs
    assert drive.al_status(SERVO) == (8, 0)
    drive.let_pass(1)
    assert drive.al_status(SERVO) == (0x14, SYNCHRONISATION_ERROR)
    with pytest.raises(ValueError, match="sync_missed_limit"):
        Servo(sync_missed_limit=0)


def value_of_limit(drive: Drive) -> int:
    drive.start_mailbox(SERVO)
    return value(drive, 0x10F1, 2)


def test_outputs_shortly_before_a_pulse_wait_for_the_next(drive: Drive) -> None:
    """The device needs 20 us to copy outputs after the end of the frame, which takes 7 us."""
    drive.operational()
    drive.cycles(5, phase=960)
    assert drive.segment.core.synchronous(DEVICE)[2:5] == (0, 0, 0)
    drive.until(985)
    drive.swap()
    drive.until(500)
    assert drive.segment.core.synchronous(DEVICE)[2:5] == (1, 0, 1)
    drive.cycles(3)
    assert drive.al_status(SERVO) == (8, 0)


def test_lost_pulses_are_a_fatal_error(drive: Drive) -> None:
    drive.operational()
    drive.enable()
    drive.put_number(DEVICE, ACTIVATION, "<B", 0)
    drive.cycles(8)
    assert drive.al_status(SERVO) == (0x14, FATAL_SYNC_ERROR)
    assert drive.servo.drive_state() in ("FAULT", "FAULT REACTION ACTIVE")
    word = drive.swap()[0]
    drive.cycles(40)
    assert (
        drive.swap()[0] & 0x4F == 0x08
    )  # the fault is visible, although inputs are no longer latched
    assert word


def test_device_recovers_after_missed_pulses(drive: Drive) -> None:
    drive.operational()
    drive.let_pass(10)
    assert drive.al_status(SERVO) == (0x14, SYNCHRONISATION_ERROR)
    assert drive.request(SERVO, 0x14) == (4, 0)
    drive.write(SERVO, 0x0120, struct.pack("<H", 8))
    drive.cycles(10)
    assert drive.al_status(SERVO) == (8, 0)
    drive.cycles(10)
    assert drive.al_status(SERVO) == (8, 0)


def test_shortened_cycle_is_counted(drive: Drive) -> None:
    drive.operational()
    drive.until(500)
    drive.put_number(DEVICE, SYNC0_CYCLE, "<I", 30_000)
    drive.let_pass(0.6)
    assert drive.segment.core.synchronous(DEVICE)[3] > 0


def test_frozen_device_neither_steps_nor_counts(drive: Drive) -> None:
    drive.operational()
    drive.servo.freeze()
    drive.let_pass(5)
    assert drive.segment.core.synchronous(DEVICE)[2] == 0


def test_synchronisation_restarts_after_a_power_cycle(drive: Drive) -> None:
    drive.operational()
    drive.segment.inject(power_cycle(DEVICE, for_=0.01))
    drive.let_pass(20)
    drive.number_stations()
    assert drive.number(DEVICE, ACTIVATION, "<B") == 0
    assert drive.number(DEVICE, SYNC0_CYCLE, "<I") == 0
    assert not drive.segment.core.synchronous(DEVICE)[0]
    drive.operational()
    drive.cycles(20)
    assert drive.al_status(SERVO) == (8, 0)


@pytest.mark.parametrize("phase", [100.0, 900.0])
def test_unsteered_device_misses_no_pulse(phase: float) -> None:
    """The clock has an error of 100 ppm, but one frame arrives in each interval of its pulses."""
    drive = Drive(Servo(crystal=Crystal(ppm=100)))
    drive.operational()
    for _ in range(300):
        drive.let_pass((drive.first + round(phase * 1e3) - drive.system_time(DEVICE)) % MS / MS)
        drive.swap()
    missed = drive.segment.core.synchronous(DEVICE)[2]
    assert (missed, drive.al_status(SERVO)) == (0, (8, 0))


# -- quirks ------------------------------------------------------------------------------------


def test_sync1_drive_shows_only_that_type() -> None:
    drive = Drive(Servo(quirks=ServoQuirks(sync_signal="sync1")))
    drive.start_mailbox(SERVO)
    assert value(drive, 0x1C32, 4) == 0x0009  # free run, DC SYNC1
    assert drive.download(SERVO, 0x1C32, 1, b"\x02\0") == 0x06090030
    assert drive.download(SERVO, 0x1C32, 1, b"\x03\0") == 0
    drive.switch_on(activation=0x03)
    assert drive.safe_op() == (0x12, INVALID_DC)


@pytest.mark.parametrize(("later", "every"), [(0, 1), (300_000, 1), (3 * MS, 4)])
def test_sync1_occurs_with_the_first_sync0_after_its_time(later: int, every: int) -> None:
    drive = Drive(Servo(quirks=ServoQuirks(sync_signal="sync1")))
    drive.start_mailbox(SERVO)
    drive.put_number(DEVICE, SYNC1_CYCLE, "<I", later)
    drive.switch_on(activation=0x05)
    assert drive.safe_op() == (4, 0)
    assert value(drive, 0x1C32, 2) == every * MS
    drive.let_pass(40)
    before = drive.segment.core.pulses(DEVICE)[1]
    drive.let_pass(60)
    sync0, sync1 = drive.segment.core.pulses(DEVICE)
    assert sync0 == 0
    assert sync1 - before == 60 // every
    assert drive.segment.core.synchronous(DEVICE)[1]


@pytest.mark.parametrize("modes", [EL3702, SYNC1_ALONE, EASYCAT, EASYCAT_STORED])
def test_sii_contains_the_given_op_modes(modes: tuple[OpMode, ...]) -> None:
    drive = Drive(Servo(quirks=ServoQuirks(op_modes=modes)))
    sii = decode_sii(drive.segment.core.sii_image(DEVICE))
    assert [
        (
            *(sii.string(mode.name), mode.assign_activate, mode.cycle_time_ns, mode.sync0_factor),
            *(mode.shift_time_ns, mode.sync1_factor, mode.shift_time_1_ns),
        )
        for mode in sii.clock_modes
    ] == [
        (
            *(mode.name, mode.assign_activate, mode.sync0_ns, mode.sync0_factor),
            *(mode.shift_ns, mode.sync1_factor, mode.sync1_shift_ns),
        )
        for mode in modes
    ]


def test_op_mode_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="shift_ns must be a signed 32-bit number"):
        OpMode(name="DC", shift_ns=1 << 31)
    with pytest.raises(ValueError, match="assign_activate must be an unsigned 16-bit"):
        OpMode(name="DC", assign_activate=-1)
