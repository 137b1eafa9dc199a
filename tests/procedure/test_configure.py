"""Configuration of process data and verification of the watchdog."""

from __future__ import annotations

import pytest

from catenary.errors import ConfigurationError
from catenary.plan.options import PlanOptions
from catenary.plan.planner import make_plan
from catenary.procedure.configure import configure_process_data
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.station import Station
from catenary.wire.datagram import EcatCommand
from tests.plan.devices import coupler, servo
from tests.procedure.player import play

STATION = Station(0, 0x1001, "Servo")


class Memory:
    """Owner of a controller's registers. `stuck` has the constant bytes, by address."""

    def __init__(self, stuck: dict[int, int] | None = None) -> None:
        self.stuck = stuck or {}
        self.bytes: dict[int, int] = {}

    def __call__(self, request: Request) -> Reply:
        assert request.address & 0xFFFF == STATION.address
        start = request.address >> 16
        span = range(start, start + len(request.data))
        if request.command is EcatCommand.FPWR:
            self.bytes |= dict(zip(span, request.data, strict=True)) | self.stuck
            return Reply(request.data, 1)
        assert request.command is EcatCommand.FPRD
        return Reply(bytes(self.bytes.get(address, 0) for address in span), 1)


class LockedMemory(Memory):
    """As ETG.1000.4 §6.7.2: an enabled SyncManager keeps its start, length and control."""

    def __call__(self, request: Request) -> Reply:
        start = request.address >> 16
        if (
            request.command is EcatCommand.FPWR
            and 0x0800 <= start < 0x0880
            and len(request.data) == 8
        ):
            enabled = self.bytes.get(start + 6, 0) & 1
            self.stuck = {k: self.bytes[k] for k in range(start, start + 5)} if enabled else {}
        return super().__call__(request)


def configure(memory: Memory, watchdog: float | None = None) -> Memory:
    device = servo(0)
    plan = make_plan([device], options=PlanOptions(watchdog=watchdog)).devices[0]
    play(configure_process_data(STATION, device, plan), memory)
    return memory


def test_the_watchdog_is_on_with_a_trigger() -> None:
    registers = configure(Memory()).bytes
    assert (registers[0x0420], registers[0x0421]) == (0xE8, 0x03)
    assert registers[0x0814] == 0x64


def test_the_watchdog_is_off_without_a_trigger() -> None:
    registers = configure(Memory(), watchdog=0).bytes
    assert (registers[0x0420], registers[0x0421]) == (0, 0)
    assert registers[0x0814] == 0x24


@pytest.mark.parametrize(
    ("stuck", "message"),
    [
        (
            {0x0814: 0x24},
            r"device 0 \(Servo\): register 0x0814 \(SyncManager 2 control\): wrote 0x64, "
            r"read back 0x24 \(bit 6, watchdog trigger: 0\)",
        ),
        (
            {0x0420: 0, 0x0421: 0},
            r"device 0 \(Servo\): register 0x0420 \(.*\): wrote 0x03E8, read back 0x0000",
        ),
        ({0x0400: 0}, r"register 0x0400 \(watchdog divider\): wrote 0x09C2, read back 0x0900"),
    ],
)
def test_a_register_that_does_not_keep_its_value(stuck: dict[int, int], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message) as caught:
        configure(Memory(stuck))
    assert "use watchdog=0" in str(caught.value.hint)


def test_a_device_without_a_watchdog_works_with_watchdog_0() -> None:
    configure(Memory({0x0400: 0, 0x0401: 0, 0x0420: 0, 0x0421: 0, 0x0814: 0x24}), watchdog=0)


def test_other_bits_of_the_control_byte_are_not_verified() -> None:
    configure(Memory({0x0814: 0x44}))


def test_a_device_without_outputs_has_no_watchdog_to_write() -> None:
    device = coupler(0)
    memory = Memory()
    play(configure_process_data(STATION, device, make_plan([device]).devices[0]), memory)
    assert not {0x0400, 0x0420} & memory.bytes.keys()


def test_a_second_plan_with_another_length_is_written() -> None:
    memory = LockedMemory()
    configure(memory)
    memory.bytes[0x0812] = 0xFF  # the length of another plan
    assert configure(memory).bytes[0x0812] != 0xFF
