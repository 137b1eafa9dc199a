"""`catenary doctor`, on this machine and on simulated ones."""

from __future__ import annotations

import json
import socket

import pytest

from catenary import doctor
from catenary.cli.main import main
from catenary.doctor import examination
from tests.doctor import machines


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Simulated laptop that replaces this machine; changes go to its own files."""
    root = tmp_path / "laptop"
    laptop = machines.make(root, machines.LAPTOP)
    monkeypatch.setattr(doctor, "this_machine", lambda *_, **__: laptop)
    monkeypatch.setattr(doctor, "MachineGround", lambda: doctor.change.MachineGround(root))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return laptop


def test_this_machine(capsys):
    status = main(["doctor", "--seconds", "0.1"])
    out = capsys.readouterr().out
    assert out.startswith("Kernel\n")
    assert " wake-ups with a period of 1000 us: median " in " ".join(out.split())
    assert status == (1 if " is not ready " in out else 0)


def test_json(capsys):
    main(["doctor", "lo", "--json", "--seconds", "0.1", "--period", "0.002"])
    report = json.loads(capsys.readouterr().out)
    statuses = {check["id"]: check["status"] for check in report["checks"]}
    assert statuses["nic-driver"] == "FAIL"
    assert report["latency_us"]["period"] == 2000.0
    assert report["latency_us"]["count"] > 0


def test_frames_of_other_programs(veth, monkeypatch, capsys):
    measure = examination.measure

    def send_and_measure(*arguments, **options):
        with socket.socket(socket.AF_PACKET, socket.SOCK_RAW) as sender:
            sender.bind((veth[0], 0))
            sender.send(bytes(60))
        return measure(*arguments, **options)

    monkeypatch.setattr(examination, "measure", send_and_measure)
    main(["doctor", veth[0], "--seconds", "0.1", "--json"])
    checks = {check["id"]: check for check in json.loads(capsys.readouterr().out)["checks"]}
    assert checks["nic-traffic"]["status"] == "WARN"
    assert "other programs sent" in checks["nic-traffic"]["found"]


def test_a_wire(veth, capsys):
    main(["doctor", veth[0], "--seconds", "0"])
    out = capsys.readouterr().out
    assert "veth: a software interface without a card" in out
    assert "not measured" in out


def test_exit_status(machine, tmp_path, monkeypatch, capsys):
    assert main(["doctor", "--seconds", "0"]) == 1
    good = machines.controller(tmp_path / "controller")
    monkeypatch.setattr(doctor, "this_machine", lambda *_, **__: good)
    assert main(["doctor", "--seconds", "0"]) == 0


def test_an_unknown_card(capsys):
    assert main(["doctor", "nope"]) == 2
    err = capsys.readouterr().err
    assert "there is no network interface 'nope'" in err
    assert "hint: use one of " in err


def test_an_unknown_cpu(capsys):
    assert main(["doctor", "--cpu", "5000"]) == 2
    assert "CPU 5000 does not exist" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--apply", "--undo"], "not allowed with"),
        (["--seconds", "-1"], "is not between"),
        (["--period", "1e-9"], "use at least 20 us"),
        (["--priority", "100"], "priority 100 is outside 1 to 99"),
    ],
)
def test_usage(capsys, arguments, words):
    with pytest.raises(SystemExit) as exit:
        main(["doctor", *arguments])
    assert exit.value.code == 2
    assert words in capsys.readouterr().err


def test_json_cannot_be_combined_with_apply(capsys):
    assert main(["doctor", "--json", "--apply"]) == 2
    assert "--json cannot be combined" in capsys.readouterr().err


def test_apply_lists_the_changes_first_and_undo_reverts_them(machine, capsys):
    pages = machine.path("/sys/kernel/mm/transparent_hugepage/enabled")
    assert main(["doctor", "--seconds", "0", "--apply", "--yes"]) == 1  # checks failed
    out = capsys.readouterr().out
    target = "/sys/kernel/mm/transparent_hugepage/enabled"
    listed, done = out.index(f"{target}: always -> madvise"), out.index(f"done: {target}")
    assert listed < done
    assert pages.read_text() == "madvise"
    assert main(["doctor", "--undo"]) == 0
    assert f"undone: {target} = always" in capsys.readouterr().out
    assert pages.read_text() == "always"
    assert main(["doctor", "--undo"]) == 0
    assert "Nothing to undo" in capsys.readouterr().out


@pytest.mark.parametrize(("answer", "after"), [("y", "madvise"), ("", "[always] madvise never\n")])
def test_apply_asks(machine, monkeypatch, capsys, answer, after):
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda _: answer)
    assert main(["doctor", "--seconds", "0", "--apply"]) == 1  # checks failed
    assert machine.path("/sys/kernel/mm/transparent_hugepage/enabled").read_text() == after


@pytest.mark.parametrize(("locked", "status"), [(False, 0), (True, 1)])
def test_exit_status_of_apply(tmp_path, monkeypatch, capsys, locked, status):
    """The exit status is 0 if no check failed and no change was refused."""
    pages = "/sys/kernel/mm/transparent_hugepage/enabled"
    root = tmp_path / "controller"
    machine = machines.controller(root, **{pages: "[always] madvise never\n"})
    monkeypatch.setattr(doctor, "this_machine", lambda *_, **__: machine)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    ground = doctor.change.MachineGround(root)

    class Refusing:
        read = staticmethod(ground.read)

        def write(self, target, value):
            raise PermissionError(1, "Operation not permitted", target)

    monkeypatch.setattr(doctor, "MachineGround", lambda: Refusing() if locked else ground)
    assert main(["doctor", "--seconds", "0", "--apply", "--yes"]) == status
    assert ("REFUSED" in capsys.readouterr().out) is locked


def test_apply_without_a_terminal(machine, monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    assert main(["doctor", "--seconds", "0", "--apply"]) == 2
    assert "hint: use --apply --yes" in capsys.readouterr().err
