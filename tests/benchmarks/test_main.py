"""`python -m benchmarks`: every example of its help parses, a wrong command line is two lines."""

from __future__ import annotations

import argparse
import shlex

import pytest

from benchmarks.cli.main import PROGRAM, main, make_parser

[COMMANDS] = (
    action.choices
    for action in make_parser()._actions
    if isinstance(action, argparse._SubParsersAction)
)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_help_has_an_example_that_parses(name: str) -> None:
    _, _, examples = COMMANDS[name].format_help().partition("example:\n")
    calls = [line.strip() for line in examples.splitlines() if line.strip()]
    assert calls
    for call in calls:
        assert call.startswith(f"{PROGRAM} {name} ")
        make_parser().parse_args(shlex.split(call.removeprefix(PROGRAM)))


@pytest.mark.parametrize(
    "line", ["", "loop --drives 0", "soak --minutes 1 --json nowhere/soak.json", "lop"]
)
def test_a_wrong_command_line_is_one_line_a_hint_and_status_2(
    line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(line.split())
    assert caught.value.code == 2
    message, hint = capsys.readouterr().err.splitlines()
    assert message.startswith(PROGRAM)
    assert hint.startswith(f"  hint: {PROGRAM}")


def test_an_error_names_the_program(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["table", "no-such-table"]) == 2
    assert capsys.readouterr().err.startswith(f"{PROGRAM}: ")
