"""Register commands of an ENI: working counters, repetitions, and validation with a deadline."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from catenary.errors import ConfigurationError
from catenary.model.register_command import RegisterCommand, Validation
from catenary.procedure.exchange import Reply, Request, physical
from catenary.procedure.register_commands import run_commands
from catenary.wire.datagram import EcatCommand
from tests.procedure.player import STATION, play

WRITE = RegisterCommand(("PS",), 5, 1001 | 0x0F80 << 16, b"\x01", count=1, retries=2)
CHECK = RegisterCommand(
    ("IP", "PS"), 1, 0x0F80 << 16, b"\0", count=1, validation=Validation(b"\x04", b"\x0c", 0.1)
)


class Device:
    """Owner of the replies of a device, and of the requests that it received."""

    def __init__(self, answer: Callable[[int], Reply]) -> None:
        self.answer = answer
        self.requests: list[Request] = []

    def __call__(self, request: Request) -> Reply:
        self.requests.append(request)
        return self.answer(len(self.requests))


def good(_: int) -> Reply:
    return Reply(b"\x04", 1)


def test_only_the_commands_of_the_transition_are_sent_in_order() -> None:
    device = Device(good)
    play(run_commands(STATION, [CHECK, WRITE], "IP"), device)
    assert [each.command for each in device.requests] == [EcatCommand.FPRD]
    device = Device(good)
    play(run_commands(STATION, [CHECK, WRITE], "PS"), device)
    assert [each.command for each in device.requests] == [EcatCommand.FPRD, EcatCommand.FPWR]
    play(run_commands(STATION, [CHECK, WRITE], "SO"), Device(lambda _: pytest.fail("sent")))


def test_the_station_address_is_that_of_catenary() -> None:
    device = Device(good)
    play(run_commands(STATION, [WRITE], "PS"), device)
    assert device.requests[0].address == physical(STATION.address, 0x0F80)
    assert device.requests[0].data == b"\x01"


@pytest.mark.parametrize("fault", [Reply(b"\x01", 0), Reply(b"\x01", 2), Reply(b"", 0, lost=True)])
def test_a_wrong_working_counter_is_repeated_as_often_as_stated(fault: Reply) -> None:
    device = Device(lambda number: fault if number < 3 else Reply(b"\x01", 1))
    play(run_commands(STATION, [WRITE], "PS"), device)
    assert len(device.requests) == 3
    device = Device(lambda _: fault)
    with pytest.raises(ConfigurationError, match=r"command at PS to register 0x0F80"):
        play(run_commands(STATION, [WRITE], "PS"), device)
    assert len(device.requests) == 3


def test_without_cnt_any_working_counter_is_accepted() -> None:
    command = RegisterCommand(("PS",), 5, 0x0F80 << 16, b"\x01")
    play(run_commands(STATION, [command], "PS"), Device(lambda _: Reply(b"\x01", 0)))


def test_a_reply_is_read_until_its_masked_bits_are_right() -> None:
    device = Device(lambda number: Reply(b"\xf7" if number == 5 else b"\x08", 1))
    play(run_commands(STATION, [CHECK], "PS"), device)
    assert len(device.requests) == 5


def test_a_validation_ends_after_its_timeout() -> None:
    device = Device(lambda _: Reply(b"\x08", 1))
    with pytest.raises(ConfigurationError, match="expected 04 under mask 0c, read 08"):
        play(run_commands(STATION, [CHECK], "PS"), device, steps=1000)
    assert len(device.requests) > 5


def test_a_validation_needs_an_answer() -> None:
    command = RegisterCommand(
        ("PS",), 1, 0x0F80 << 16, b"\0", validation=Validation(b"\0", b"\xff", 0.1)
    )
    with pytest.raises(ConfigurationError, match="expected working counter at least 1, received 0"):
        play(run_commands(STATION, [command], "PS"), Device(lambda _: Reply(b"\0", 0)))
