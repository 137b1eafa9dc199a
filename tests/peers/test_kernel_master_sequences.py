"""A simulated IgH kernel master (`kernel_master.py`) tests the virtual segment.

Its frames are those of scan, configuration and operation. Errors that it would log are failures.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

import pytest

from catenary.virtual import (
    AnalogInputs,
    Coupler,
    DigitalInputs,
    DigitalOutputs,
    Segment,
    Servo,
)
from tests.peers.kernel_master import (
    FPRD,
    FPWR,
    INIT,
    OP,
    PRE_OP,
    SAFE_OP,
    Abort,
    Complaint,
    Domain,
    KernelMaster,
    Slave,
)

COUPLER, OUTPUTS, SERVO, SERVO_2, ANALOG, INPUTS = range(6)


def line() -> Segment:
    return Segment(
        [
            Coupler(alias=7),
            DigitalOutputs(),
            Servo(serial=1),
            Servo(serial=2, alias=99),
            AnalogInputs(),
            DigitalInputs(),
        ]
    )


@pytest.fixture
def segment() -> Segment:
    return line()


@pytest.fixture
def master(segment: Segment) -> Iterator[KernelMaster]:
    played = KernelMaster(segment)
    yield played
    played.close()


@pytest.fixture
def slaves(master: KernelMaster) -> list[Slave]:
    return master.scan()


def operate(master: KernelMaster, slaves: list[Slave], **options: int) -> Domain:
    """Configure all devices to OP with one running domain."""
    domain = Domain(0)
    for slave in slaves:
        domain.add(slave)
    master.domains = [domain]
    master.clock = next(slave for slave in slaves if slave.has_dc)
    master.write_system_times()
    for slave in slaves:
        cycle = options.get("sync0", 0) if slave.has_dc and slave.mailbox_protocols else 0
        master.configure(slave, sync0=cycle)
    master.tick()
    return domain


def test_scan(master: KernelMaster, slaves: list[Slave]) -> None:
    assert len(slaves) == 6
    assert [slave.word(0x04) for slave in slaves] == [7, 0, 0, 99, 0, 0]
    assert [bool(slave.mailbox_protocols) for slave in slaves] == [0, 0, 1, 1, 1, 0]
    servo = slaves[SERVO]
    assert servo.state == PRE_OP
    assert servo.word(0x08) | servo.word(0x09) << 16 == 0x43544E59
    assert list(servo.pdos) == [2, 3]
    assert [len(v) for pdos in servo.pdos.values() for v in pdos.values()] == [5, 5]
    assert (servo.size(2), servo.size(3)) == (13, 13)
    assert slaves[COUPLER].state == INIT  # no CoE: unchanged until it is configured


def test_topology_and_delays(slaves: list[Slave]) -> None:
    # DL status: link of port 0 and 1, loop closed after the last (slave.c, ec_slave_set_dl_status)
    for slave in slaves:
        last = slave is slaves[-1]
        assert bool(slave.dl_status & 1 << 4)
        assert bool(slave.dl_status & 1 << 5) is not last
        assert bool(slave.dl_status & 1 << 10) is last
    delays = [slave.delay for slave in slaves if slave.has_dc]
    assert delays == sorted(delays)
    assert delays[0] == 0 < delays[-1] < 100_000


def test_the_sii_can_be_read_by_position(master: KernelMaster, slaves: list[Slave]) -> None:
    # fsm_sii.c with EC_FSM_SII_USE_INCREMENT_ADDRESS
    master.ask_one(2, -SERVO, 0x0502, struct.pack("<BBH", 0x80, 0x01, 0x08))
    master.run(3)
    data = master.ask_one(1, -SERVO, 0x0502, 10)
    assert data[6:10] == slaves[SERVO].sii[16:20]


def test_alias_is_written_and_read_back(master: KernelMaster, slaves: list[Slave]) -> None:
    # ioctl.c, ec_ioctl_slave_sii_write through fsm_master.c, ec_fsm_master_state_write_sii
    servo = slaves[SERVO]
    master.write_sii(servo, 0x04, 1234)
    assert master.read_sii(servo, 0x04)[:2] == struct.pack("<H", 1234)
    assert master.read_sii(servo, 0x08) == servo.sii[16:20]


def test_operation(master: KernelMaster, slaves: list[Slave], segment: Segment) -> None:
    domain = operate(master, slaves)
    assert (
        domain.expected == 2 * 3 + 4
    )  # outputs: terminal, servos; inputs: servos, analogue, digital
    assert [device.state for device in segment] == [OP] * 6
    for _ in range(1000):
        master.tick()
        assert domain.counter == domain.expected
    assert master.broadcast() == (6, OP)


def test_outputs_and_inputs_are_exchanged(
    master: KernelMaster, slaves: list[Slave], segment: Segment
) -> None:
    domain = operate(master, slaves)
    servo_in = domain.slice(slaves[SERVO], output=False)
    servo_out = domain.slice(slaves[SERVO], output=True)
    for controlword, masked in ((0x80, 0x40), (0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        domain.image[servo_out] = struct.pack("<HbiiH", controlword, 8, 0, 0, 0)
        master.run(300)
        status = int.from_bytes(domain.image[servo_in][:2], "little")
        assert status & 0x6F == masked, hex(status)
    domain.image[domain.slice(slaves[OUTPUTS], output=True)] = b"\x05"
    master.run(5)
    outputs = segment[OUTPUTS]
    assert isinstance(outputs, DigitalOutputs)
    assert outputs.outputs == 0b0101


@pytest.mark.parametrize(
    ("positions", "expected"),
    [((OUTPUTS,), 1), ((ANALOG, INPUTS), 2), ((SERVO,), 3), ((SERVO, ANALOG), 4)],
)
def test_counters_of_domains(
    master: KernelMaster, slaves: list[Slave], positions: tuple[int, ...], expected: int
) -> None:
    # LWR 1, LRD 1, LRW 2 + 1 (datagram_pair.c)
    domain = Domain(0x10000)
    for position in positions:
        domain.add(slaves[position])
    master.domains = [domain]
    for position in positions:
        master.configure(slaves[position])
    master.tick()
    assert domain.counter == domain.expected == expected


def test_two_domains_with_separate_logical_addresses(
    master: KernelMaster, slaves: list[Slave]
) -> None:
    first, second = Domain(0), Domain(64)
    first.add(slaves[SERVO])
    second.add(slaves[SERVO_2])
    master.domains = [first, second]
    for position in (SERVO, SERVO_2):
        master.configure(slaves[position])
    master.run(10)
    assert (first.counter, second.counter) == (3, 3)


def test_clocks(master: KernelMaster, slaves: list[Slave]) -> None:
    domain = operate(master, slaves, sync0=1_000_000)
    master.run(2000)
    assert domain.counter == domain.expected
    for slave in slaves:
        if slave.has_dc:
            assert master.difference(slave) < 1000
            time = master.ask_one(FPRD, slave.station, 0x0910, 8)
            assert abs(int.from_bytes(time, "little") - master.app_time) < 5_000_000
    servo = slaves[SERVO]
    assert master.ask_one(FPRD, servo.station, 0x0980, 2) == b"\x00\x03"
    assert struct.unpack("<II", master.ask_one(FPRD, servo.station, 0x09A0, 8)) == (1_000_000, 0)


def test_clocks_that_ran_before_their_offset_was_set(
    master: KernelMaster, slaves: list[Slave]
) -> None:
    """The application is faster than the state machine: the offset follows after wrong times."""
    master.clock = slaves[COUPLER]
    master.run(200)
    operate(master, slaves, sync0=1_000_000)
    master.run(2000)
    assert all(master.difference(slave) < 1000 for slave in slaves if slave.has_dc)


def test_sdo_uploads(master: KernelMaster, slaves: list[Slave]) -> None:
    servo = slaves[SERVO]
    assert master.upload(servo, 0x1000, 0) == struct.pack("<I", 0x20192)  # expedited
    assert master.upload(servo, 0x1018, 4) == struct.pack("<I", 1)
    assert len(master.upload(servo, 0x1008, 0)) > 4  # normal
    blob = master.upload(servo, 0x2100, 0)  # segmented
    assert blob == bytes(k * 7 & 0xFF for k in range(2048))


@pytest.mark.parametrize(
    ("index", "subindex", "code"),
    [(0x7777, 0, 0x06020000), (0x1018, 9, 0x06090011)],
)
def test_sdo_aborts(
    master: KernelMaster, slaves: list[Slave], index: int, subindex: int, code: int
) -> None:
    with pytest.raises(Abort) as caught:
        master.upload(slaves[SERVO], index, subindex)
    assert caught.value.code == code
    assert master.upload(slaves[SERVO], 0x1018, 0) == b"\x04"


@pytest.mark.parametrize("size", [1, 4, 5, 7, 112, 113, 118, 119, 120, 250, 2048])
def test_sdo_downloads(master: KernelMaster, slaves: list[Slave], size: int) -> None:
    data = bytes(k * 3 & 0xFF for k in range(size))
    master.download(slaves[SERVO], 0x2101, 0, data)
    assert master.upload(slaves[SERVO], 0x2101, 0) == data


def test_a_refused_download(master: KernelMaster, slaves: list[Slave]) -> None:
    with pytest.raises(Abort) as caught:
        master.download(slaves[SERVO], 0x1018, 1, bytes(4))
    assert caught.value.code == 0x06010002


def test_dictionary(master: KernelMaster, slaves: list[Slave]) -> None:
    analog = slaves[ANALOG]
    assert analog.sdo_information
    objects = master.dictionary(analog)
    assert {0x1000, 0x1018, 0x1C12, 0x1C13, 0x2100} <= set(objects)
    assert objects[0x1018][1][0] == 32
    assert all(name for entries in objects.values() for _, _, name in entries.values())


def test_an_emergency_before_the_answer(
    master: KernelMaster, slaves: list[Slave], segment: Segment
) -> None:
    servo = segment[SERVO]
    assert isinstance(servo, Servo)
    servo.send_emergency(0x4210)
    assert master.upload(slaves[SERVO], 0x1018, 0) == b"\x04"


def test_a_refused_state_is_acknowledged(
    master: KernelMaster, slaves: list[Slave], segment: Segment
) -> None:
    servo = segment[SERVO]
    assert isinstance(servo, Servo)
    servo.refuse_state(SAFE_OP, 0x0024)
    with pytest.raises(Complaint, match="0x0024"):
        master.configure(slaves[SERVO])
    assert slaves[SERVO].state == PRE_OP
    servo.refuse_state(SAFE_OP, None)
    domain = operate(master, slaves)
    assert domain.counter == domain.expected


def test_a_device_without_outputs_leaves_op_and_is_acknowledged(
    master: KernelMaster, slaves: list[Slave]
) -> None:
    """The application stops, watchdogs expire, and the master configures the device again."""
    operate(master, slaves)
    domains, master.domains = master.domains, []
    master.run(300)
    _, states = master.broadcast()
    assert states & 0x10
    for slave in slaves:
        slave.state = master.ask_one(FPRD, slave.station, 0x0130, 2)[0]
        if slave.state & 0x10:
            assert master.acknowledge(slave) == 0x001B
            assert slave.state == SAFE_OP
    master.domains = domains
    for slave in slaves:
        master.configure(slave)
    master.tick()
    assert domains[0].counter == domains[0].expected


@pytest.mark.parametrize("state", [PRE_OP, INIT])
def test_states_on_the_way_down(
    master: KernelMaster, slaves: list[Slave], segment: Segment, state: int
) -> None:
    operate(master, slaves)
    for slave in slaves:
        master.change(slave, INIT)
        if state == PRE_OP:
            master.to_pre_op(slave)
    assert [device.state for device in segment] == [state] * 6


@pytest.mark.parametrize("gap", range(9))
def test_a_stop_is_quick_despite_errors(
    master: KernelMaster, slaves: list[Slave], segment: Segment, gap: int
) -> None:
    """The application stops with clocks. Drives miss outputs before and after INIT requests.

    A lost request costs 5 s (fsm_change.c, ec_fsm_change_timeout_ms).
    """
    operate(master, slaves, sync0=1_000_000)
    master.domains = []
    master.run(gap)
    start = master.link.now()
    for slave in slaves:
        master.change(slave, INIT)
    assert master.link.now() - start < 100_000_000
    assert [device.state for device in segment] == [INIT] * 6


def test_a_second_master_finds_the_segment_in_op(segment: Segment) -> None:
    first = KernelMaster(segment)
    operate(first, first.scan())
    first.post(first.slaves[SERVO], struct.pack("<HBHB4x", 0x2000, 0x40, 0x1008, 0))
    first.run(5)  # its answer stays in the mailbox
    first.close()
    second = KernelMaster(segment)
    slaves = second.scan()
    # the scan sends no outputs, so the watchdogs must have expired
    assert [slave.state for slave in slaves] == [OP, OP, SAFE_OP | 0x10, SAFE_OP | 0x10, OP, OP]
    for slave in slaves[SERVO : SERVO_2 + 1]:
        assert second.acknowledge(slave) == 0x001B
    assert slaves[SERVO].size(2) == 13
    domain = operate(second, slaves)
    assert domain.counter == domain.expected
    second.close()


def test_the_application_reads_registers(master: KernelMaster, slaves: list[Slave]) -> None:
    # fsm_slave.c, ec_fsm_slave_action_process_reg
    servo = slaves[SERVO]
    assert len(master.ask_one(FPRD, servo.station, 0x0300, 20)) == 20
    master.ask_one(FPWR, servo.station, 0x0300, bytes(1))
    assert master.ask_one(FPRD, servo.station, 0x0012, 2) == bytes(2)
    assert master.ask_one(FPRD, slaves[SERVO_2].station, 0x0012, 2) == struct.pack("<H", 99)
