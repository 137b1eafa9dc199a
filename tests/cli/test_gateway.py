"""`catenary gateway`: the table, the service, the end by a signal, and wrong command lines."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from catenary.cli.main import main
from tests.gateway.tool import Aborted, Tool


def test_it_serves_until_a_signal() -> None:
    command = [sys.executable, "-m", "catenary.cli", "gateway", "virtual", "--port", "0"]
    with subprocess.Popen(
        [*command, "--write", "2"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline()]
        while "press Ctrl-C" not in lines[-1]:
            assert lines[-1], "the command has ended"
            lines.append(process.stdout.readline())
        port = int(lines[-1].split(";")[0].split()[-1])
        with Tool(port, address=0x1003) as tool:
            tool.download(0x6065, 0, b"\x01\x02\x00\x00")
            assert tool.upload(0x6065) == b"\x01\x02\x00\x00"
        with Tool(port, address=0x1004) as tool, pytest.raises(Aborted):
            tool.download(0x6065, 0, bytes(4))
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    access = {line.split()[0]: line.rstrip() for line in lines}
    assert access["0"].endswith("no mailbox")
    assert access["2"].endswith("0x1003   read, write")
    assert access["3"].endswith("0x1004   read")
    assert "SDO download 0x6065:00 through the gateway by TCP 127.0.0.1:" in rest
    assert "3 requests, 1 refused" in rest


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("gateway share:arm", "a share does not forward mailbox messages"),
        ("gateway virtual --port 70000", "port 70000 is outside 0 to 65535"),
        ("gateway virtual --write 9", "there is no device 9"),
    ],
)
def test_wrong_command_lines(line: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line.split()) == 2
    assert message in capsys.readouterr().err
