"""While two drives move, clients of the gateway send garbage, connect again and again, never read,
leave in the middle of transfers, and try to stop, reconfigure and reprogram the drives. No cycle is
lost, no drive reacts, and a tool that behaves well is still served.
"""

import random
import socket
import struct
import threading
from collections.abc import Callable

import pytest

import catenary as cat
from tests.gateway.line import CONTENT, Line
from tests.gateway.tool import Aborted, Tool

ROUNDS = 40


def send_garbage(port: int) -> None:
    chance = random.Random(56)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
        for _ in range(ROUNDS):
            data = chance.randbytes(chance.randrange(1, 300))
            datagrams.sendto(data, ("127.0.0.1", port))
            with socket.create_connection(("127.0.0.1", port)) as stream:
                stream.sendall(data)


def connect_and_leave(port: int) -> None:
    for _ in range(10 * ROUNDS):
        socket.create_connection(("127.0.0.1", port)).close()


def never_read(port: int) -> None:
    with Tool(port) as tool:
        for _ in range(ROUNDS):
            tool.send(3, struct.pack("<HBxHH", 0x8000, 1, 0, 1))


def leave_transfers(port: int) -> None:
    for number in range(3):
        with Tool(port) as tool:
            if number % 2:
                tool.begin_download(0x6065, 0, 4)
            else:
                next(tool.file_packets("log", 116))


def stop_the_drive(port: int) -> None:
    with Tool(port) as tool:
        for index in (0x6040, 0x6060, 0x607A, 0x1C12, 0x1600, 0x6840):
            for _ in range(3):
                with pytest.raises(Aborted):
                    tool.download(index, 0, bytes(2))
        with pytest.raises(Aborted):
            tool.write_file("app.efw", CONTENT)


ATTACKS = (send_garbage, connect_and_leave, never_read, leave_transfers, stop_the_drive)


def started(
    attack: Callable[[int], None], port: int, problems: list[Exception]
) -> threading.Thread:
    def run() -> None:
        try:
            attack(port)
        except ConnectionError:
            pass  # no place among the clients, which is the limit at work
        except Exception as error:
            problems.append(error)

    thread = threading.Thread(target=run, name=attack.__name__)
    thread.start()
    return thread


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.__name__)
def test_a_hostile_client_does_not_reach_the_drives(attack: Callable[[int], None]) -> None:
    problems: list[Exception] = []
    with Line() as line, cat.Gateway(line.main, write=[1, 2], port=0) as gateway:
        line.gateway = gateway
        arm = line.arm()
        with cat.Loop(arm, period=1e-3) as loop:
            move = arm.move_by(0.5)
            loop.run_for(0.01)
            thread = started(attack, gateway.port, problems)
            for _ in loop:
                if not thread.is_alive():
                    break
            loop.wait(move)
            assert [servo.drive_state() for servo in line.servos] == ["OPERATION ENABLED"] * 2
            assert loop.timing.counters["lost"] == 0
            assert arm.stopped == (None, None)
            assert _reads(line, loop) == CONTENT
        assert "app.efw" not in line.servos[0].store.files
        done = [event for event in line.writes if event.result == "done"]
    assert problems == []
    assert done == []


def _reads(line: Line, loop: cat.Loop) -> bytes:
    """Read a file with a tool that behaves well, as soon as there is a place for it."""
    found: list[bytes] = []

    def read() -> None:
        while not found:
            try:
                with line.tool() as tool:
                    found.append(tool.read_file("log"))
            except ConnectionError:
                continue

    thread = threading.Thread(target=read)
    thread.start()
    for _ in loop:
        if not thread.is_alive():
            break
    thread.join()
    return found[0]
