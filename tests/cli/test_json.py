"""Every command has the option `--json`, or a reason for its absence; the output is JSON."""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from catenary.cli.main import main, make_parser
from catenary.virtual import make_firmware
from tests.capture.recordings import record
from tests.cli.test_realtime import EXAMPLE
from tests.cli.test_sii_build import ESI
from tests.record.made import make_layout, make_rows
from tests.remote.programs import program

OUTPUT_IS_NOT_DATA = {
    "bench loop": "--json FILE writes the figures; the report is printed while rounds run",
    "bench latency": "--json FILE, as `bench loop`",
    "bench report": "prints a file that is JSON",
    "completion": "prints a script",
    "capture record": "needs a network interface: tests/cli/test_capture_record.py",
    "dashboard": "a server",
    "eoe up": "needs a TAP interface: tests/cli/test_eoe.py",
    "demo": "writes demo.json",
    "foxglove": "a server",
    "gateway": "a server",
    "include": "prints one path, for a compiler's command line",
    "ros2": "a server",
    "shell": "interactive",
    "top": "interactive",
    "virtual serve": "a server",
}
NOT_RUN_HERE = ("capture record", "eoe up")  # they have the option
LINES = """
scan virtual
state virtual
graph virtual
diag virtual
pdos virtual
messages virtual
sdo read virtual 2 0x1018:1
sdo write virtual 2 0x6065 5000 --type UDINT
sdo list virtual 2
foe read virtual:files.toml 1 log.txt
foe write virtual:files.toml 1 app.efw --boot
firmware virtual:files.toml 1 app.efw
aoe info virtual:ads.toml 0 --port 0x1001
aoe read virtual:ads.toml 0 0x4020 0 4 --port 0x1001
aoe write virtual:ads.toml 0 0x4020 0 '01 02' --port 0x1001
eoe address virtual:ethernet.toml 0
soe read virtual:drive.toml 0 S-0-0051
soe write virtual:drive.toml 0 S-0-0092 150.5
soe info virtual:drive.toml 0 S-0-0047
soe list virtual:drive.toml 0 --values
soe command virtual:drive.toml 0 S-0-0099
reg read virtual 2 AL_STATUS
reg write virtual 2 0x0310 0 --size 4
alias virtual 2
sii read virtual 2 --output servo.bin
sii show servo.bin
sii write virtual 2 servo.bin
sii build drives.xml --device DR10 -o drive.bin
esi add drives.xml --library library
esi find DR20 --library library
esi show DR20 --library library
esi list --library library
esi remove drives.xml --library library
esi make virtual 2 -o made.xml
init virtual -o machine.toml
check machine.toml
clone virtual -o line
capture show a.pcapng
capture diff a.pcapng a.pcapng
capture sdo a.pcapng --device 1
doctor lo --seconds 0.05
realtime analyse tasks.toml
data SHARE
record SHARE arm.mcap --seconds 0.01
merge one.mcap two.mcap -o both.mcap
plot one.mcap -o one.png
"""


def leaves(
    parser: argparse.ArgumentParser, path: str = ""
) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    groups = [each for each in parser._actions if isinstance(each, argparse._SubParsersAction)]
    if not groups:
        yield path, parser
    for group in groups:
        for name, inner in group.choices.items():
            yield from leaves(inner, f"{path} {name}".strip())


ALL = dict(leaves(make_parser()))


def command_of(line: str) -> str:
    first, second, *_ = [*line.split(), ""]
    return f"{first} {second}" if f"{first} {second}" in ALL else first


COMMANDS = {command_of(line): line for line in LINES.strip().splitlines()}


@pytest.mark.parametrize("name", ALL)
def test_a_command_has_the_option_or_a_reason(name: str) -> None:
    options = [each for each in ALL[name]._actions if "--json" in each.option_strings]
    if name in OUTPUT_IS_NOT_DATA and name not in NOT_RUN_HERE:
        assert not [each for each in options if each.nargs == 0]
        return
    (option,) = options
    assert (option.nargs, option.help) == (0, "print the result as JSON")
    assert name in COMMANDS or name in NOT_RUN_HERE


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path / "esi"))
    Path("drives.xml").write_text(ESI.replace("{size}", "2048"), encoding="utf-8")
    Path("tasks.toml").write_text(EXAMPLE)
    return tmp_path


def prepare(command: str) -> None:
    """Make the files that a command reads."""
    from catenary.record.file import RecordingFile

    if command in ("sii show", "sii write"):
        assert main(shlex.split("sii read virtual 2 -o servo.bin")) == 0
    elif command in ("esi find", "esi show", "esi list", "esi remove"):
        assert main(shlex.split("esi add drives.xml --library library")) == 0
    elif command == "check":
        Path("line.toml").write_text('[[device]]\nkind = "coupler"\n')
        assert main(shlex.split("init virtual:line.toml -o machine.toml")) == 0
    elif command in ("foe read", "foe write", "firmware"):
        Path("files.toml").write_text(FILES)
        Path("app.efw").write_bytes(make_firmware(0x0004_0002, "2.0"))
    elif command.startswith("aoe"):
        Path("ads.toml").write_text(ADS)
    elif command.startswith("eoe"):
        Path("ethernet.toml").write_text(ETHERNET)
    elif command.startswith("soe"):
        Path("drive.toml").write_text('[[device]]\nkind = "sercos_drive"\n')
    elif command.startswith("capture"):
        record(Path("a.pcapng"), pdos=PDOS)
    elif command in ("merge", "plot"):
        for name in ("one", "two"):
            layout = replace(make_layout(2), name=name)
            file = RecordingFile(Path(f"{name}.mcap"), layout)
            file.write(make_rows(layout, 200))
            file.finish({"ended": "the loop ended", "lost": 0})


ADS = """
[[device]]
kind = "analog_inputs"
ads = { areas = { "0x4020" = 64 }, port = 0x1001 }
"""
ETHERNET = """
[[device]]
kind = "servo"
ethernet = {}
"""
FILES = """
[[device]]
kind = "coupler"

[[device]]
kind = "analog_inputs"

[device.files]
contents = { "log.txt" = "started" }
firmware = { name = "app.efw", version = "1.2" }
"""
PDOS = {
    0x1600: [(0x6040, 0, 16), (0x607A, 0, 32), (0x6060, 0, 8)],
    0x1A00: [(0x6041, 0, 16), (0x6064, 0, 32), (0x6061, 0, 8)],
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.usefixtures("folder")
def test_the_output_is_json(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    prepare(command)
    capsys.readouterr()
    line = f"{COMMANDS[command]} --json"
    if "SHARE" in line:
        with program() as running:
            main(shlex.split(line.replace("SHARE", running.name)))
    else:
        main(shlex.split(line))
    out = capsys.readouterr().out
    texts = out.splitlines() if command == "capture show" else [out]  # one event per line
    values = [json.loads(each, parse_constant=refuse) for each in texts]
    assert values
    assert all(values)


def refuse(constant: str) -> float:
    raise ValueError(f"{constant} is not JSON")
