"""`catenary realtime analyse`: the verdict as text and JSON, and errors that name the field."""

from __future__ import annotations

import json

import pytest

from catenary.cli.main import main

EXAMPLE = """
[[task]]
name = "tau1"
period = 0.010
execution = 0.003
priority = 30
[[task]]
name = "tau2"
period = 0.020
execution = 0.005
priority = 20
[[task]]
name = "tau3"
period = 0.040
execution = 0.010
priority = 10
"""


@pytest.fixture
def file(tmp_path):
    def write(text: str) -> str:
        path = tmp_path / "tasks.toml"
        path.write_text(text)
        return str(path)

    return write


def test_the_worked_example(file, capsys):
    assert main(["realtime", "analyse", file(EXAMPLE)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[-1] for line in lines[1:4]] == ["3.000", "8.000", "29.000"]
    assert lines[4] == "schedulable: utilisation 80.0%, hyperperiod 40 ms"


def test_json(file, capsys):
    assert main(["realtime", "analyse", file(EXAMPLE), "--json"]) == 0
    verdict = json.loads(capsys.readouterr().out)
    assert verdict["schedulable"] is True
    assert [task["response_ms"] for task in verdict["tasks"]] == [3.0, 8.0, 29.0]


def test_exit_status_1_if_a_deadline_can_be_missed(file, capsys):
    text = EXAMPLE.replace("period = 0.040", "period = 0.040\ndeadline = 0.025")
    assert main(["realtime", "analyse", file(text)]) == 1
    out = capsys.readouterr().out
    assert "29.000  MISSED" in out
    assert "NOT schedulable" in out


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (EXAMPLE.replace("0.003", '"3 ms"'), r"`float`, got `str` - at `$.task[0].execution`"),
        (EXAMPLE.replace("execution = 0.005\n", ""), "missing required field `execution`"),
        (EXAMPLE + "colour = 1\n", "unknown field `colour` - at `$.task[2]`"),
        (EXAMPLE.replace("0.020", "0"), "task 'tau2': period of 0.0 s is not positive"),
        (EXAMPLE.replace("0.005", "-1.0"), "task 'tau2': execution of -1.0 s is negative"),
        (EXAMPLE.replace("priority = 20\n", ""), "task 'tau2' has no priority"),
        (EXAMPLE.replace("tau2", "tau1"), "two tasks have the name 'tau1'"),
        (EXAMPLE.replace("0.020", "1e300"), "task 'tau2': period of 1e+300 s is beyond"),
        (EXAMPLE.replace("0.020", "nan"), "task 'tau2': period of nan s is beyond"),
        ("task = []", "there are no tasks"),
        ("[[task]", "tasks.toml: "),
    ],
)
def test_errors_name_the_field(file, capsys, text, words):
    assert main(["realtime", "analyse", file(text)]) == 1
    assert words in capsys.readouterr().err


def test_a_missing_file(capsys):
    assert main(["realtime", "analyse", "/nowhere/tasks.toml"]) == 1
    assert "/nowhere/tasks.toml: No such file" in capsys.readouterr().err
