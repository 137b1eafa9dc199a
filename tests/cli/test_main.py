"""Exit statuses, one-line errors and help of all commands."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator

import pytest

from catenary.cli import console, scan
from catenary.cli.failure import describe
from catenary.cli.main import main, make_parser
from catenary.errors import LinkError


def parsers(
    parser: argparse.ArgumentParser, path: str = "catenary"
) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    yield path, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                yield from parsers(command, f"{path} {name}")


ALL = dict(parsers(make_parser()))


@pytest.fixture
def failing_scan(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    def fail(_: argparse.Namespace) -> int:
        raise request.param

    monkeypatch.setattr(scan, "run", fail)


def test_the_documented_commands_exist() -> None:
    assert {
        "catenary scan",
        "catenary sdo read",
        "catenary sdo write",
        "catenary demo",
        "catenary bench loop",
        "catenary virtual serve",
    } <= set(ALL)


@pytest.mark.parametrize("name", ALL)
def test_every_help_has_an_example_that_parses(name: str) -> None:
    text = ALL[name].format_help()
    _, found, examples = text.partition("example:\n")
    assert found
    calls = [line.strip() for line in examples.splitlines() if line.strip().startswith("catenary")]
    assert calls
    for call in calls:
        words = re.split(r" [|>] ", call.removesuffix("&"))[0]
        make_parser().parse_args(shlex.split(words)[1:])


@pytest.mark.parametrize(
    "line",
    [
        "",
        "scann eth0",
        "scan",
        "scan eth0 eth1",
        "sdo read eth0 two 0x1018",
        "sdo read eth0 2 1018:1",
        "sdo write eth0 2 0x6065",
        "demo --seconds -1",
        "bench loop --drives 0",
        "virtual serve",
        "virtual serve veth1 --priority 100",
        "virtual serve veth1 --max-age -1",
        "bench loop --json nowhere/loop.json",
    ],
)
def test_a_usage_error_is_one_line_with_a_hint_and_status_2(
    line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(line.split())
    assert caught.value.code == 2
    message, hint = capsys.readouterr().err.splitlines()
    assert message.startswith("catenary")
    assert hint.startswith("  hint: ")


@pytest.mark.parametrize(
    ("line", "command"),
    [("demo eth0", "demo"), ("sdo read virtual 2 0x1018 --sub 1", "sdo read")],
)
def test_surplus_arguments_are_reported_by_their_command(
    line: str, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(line.split())
    assert f"hint: catenary {command} --help" in capsys.readouterr().err


@pytest.mark.parametrize("name", ALL)
def test_help_is_wrapped_to_the_terminal(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Longer lines would be broken within words."""
    monkeypatch.setenv("COLUMNS", "80")
    text = dict(parsers(make_parser()))[name].format_help()
    assert (
        max(map(len, text.partition("options:")[0].splitlines())) <= 84
    )  # the epilog of `catenary` has tables


@pytest.mark.parametrize(
    ("error", "hint"),
    [(FileExistsError, "a folder is needed"), (PermissionError, "owner and permissions")],
)
def test_file_errors_have_a_hint(error: type[OSError], hint: str) -> None:
    message, found = describe(error(1, "no", "place"))
    assert message == "place: no"
    assert hint in found


def test_outdated_compiled_modules_have_a_hint() -> None:
    error = ImportError("cannot import name 'X' from 'catenary.core._cycle'")
    error.name = "catenary.core._cycle"
    message, hint = describe(error)
    assert message.startswith("cannot import name")
    assert "make build" in hint
    assert "internal error" in describe(ImportError("no module", name="somebody"))[0]


@pytest.mark.parametrize(
    "failing_scan", [LinkError("no such interface", hint="there are: lo")], indirect=True
)
@pytest.mark.usefixtures("failing_scan")
def test_an_error_is_one_line_and_a_hint(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scan", "eth0"]) == 1
    assert capsys.readouterr().err == "catenary: no such interface\n  hint: there are: lo\n"


@pytest.mark.parametrize("failing_scan", [LinkError("no such interface")], indirect=True)
@pytest.mark.parametrize("line", ["--debug scan eth0", "scan eth0 --debug"])
@pytest.mark.usefixtures("failing_scan")
def test_debug_shows_the_traceback(line: str) -> None:
    with pytest.raises(LinkError):
        main(line.split())


@pytest.mark.parametrize("failing_scan", [KeyError("oh")], indirect=True)
@pytest.mark.usefixtures("failing_scan")
def test_an_unexpected_exception_is_an_internal_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scan", "eth0"]) == 1
    assert "internal error: KeyError: 'oh'" in capsys.readouterr().err


@pytest.mark.parametrize("failing_scan", [KeyboardInterrupt()], indirect=True)
@pytest.mark.usefixtures("failing_scan")
def test_ctrl_c_exits_silently_with_130(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["catenary", "scan", "eth0"])
    assert console.main() == 130
    assert capsys.readouterr() == ("", "")


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out.startswith("catenary ")


def test_a_closed_pipe_prints_no_error() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "catenary.cli", "--version"]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, b"")


def test_startup_imports_no_large_modules() -> None:
    code = (
        "import sys; from catenary.cli.main import make_parser; make_parser();"
        "print(*{'numpy', 'msgspec', 'catenary.core', 'subprocess'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
