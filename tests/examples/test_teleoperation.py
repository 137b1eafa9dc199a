"""examples/teleoperation: figures of the table, and gains that are refused."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from catenary.teleoperation import LinkState
from tests.examples.two_devices import FOLDER, load

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
pytest.importorskip("mujoco", reason="the devices move in MuJoCo: pip install 'catenary[sim]'")


Rows = list[dict[str, float]]


@pytest.fixture
def figures_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Rows]:
    """Return a function that runs networks in virtual time, and returns their rows."""

    def run(only: str, *more: str) -> Rows:
        words = ["--headless", "--out", str(tmp_path), "--only", only, *more]
        monkeypatch.setattr(sys, "argv", ["teleoperation.py", *words])
        load("teleoperation").main()
        rows: Rows = json.loads((tmp_path / "teleoperation.json").read_text())
        return rows

    return run


def assert_coupled(row: dict[str, float], delay: float) -> None:
    """Check that the contact is felt, without drift and without energy from the coupling."""
    assert row["bound"] > delay
    assert row["stiffness"] == pytest.approx(2.0, rel=0.03)
    assert row["felt"] == pytest.approx(1.0, abs=0.03)
    assert row["resting"] < 3.0  # [mrad]: dry friction of 2 mN·m at 2 N·m/rad, on both sides
    assert row["drift"] < 2.0  # [mrad]
    assert row["energy"] >= row["tolerance"]
    assert row["losses"] == 0


def test_the_program_writes_the_figures_of_a_network(tmp_path: Path) -> None:
    words = ["--headless", "--out", str(tmp_path), "--only", "0 ms"]
    program = [sys.executable, str(FOLDER / "teleoperation.py")]
    subprocess.run([*program, *words], check=True, timeout=300)
    [row] = json.loads((tmp_path / "teleoperation.json").read_text())
    assert_coupled(row, 0)


@pytest.mark.parametrize(("name", "delay"), [("100 ms", 200), ("20 ms, 5", 40), ("5 to 45", 50)])
def test_the_contact_is_felt_without_drift_or_energy(
    figures_of: Callable[..., Rows], name: str, delay: float
) -> None:
    assert_coupled(figures_of(name)[0], delay)


def test_gains_beyond_the_condition_create_energy_which_the_controller_bounds(
    figures_of: Callable[..., Rows],
) -> None:
    alone, controlled = figures_of("B of")
    assert alone["energy"] < 1000 * alone["tolerance"]
    assert controlled["energy"] > alone["energy"] / 10


def test_a_link_that_is_off_for_a_second_is_lost_once(figures_of: Callable[..., Rows]) -> None:
    [row] = figures_of("20 ms, off")
    assert row["losses"] == 1
    assert row["resting"] < 3.0


def test_a_damping_that_is_too_small_is_refused_with_a_better_one() -> None:
    device = load("coupling_laws")
    with pytest.raises(ValueError, match=r"raise the damping to 0\.\d+ N·m·s/rad"):
        device.gains_for(0.2, damping=0.05)
    device.gains_for(0.2)


def test_the_damping_that_the_program_chooses_always_fulfils_the_condition() -> None:
    device = load("coupling_laws")
    for delay in (0.001, 0.01, 0.1, 0.5):
        assert device.gains_for(delay).longest_delay.min() > delay


def test_a_leader_with_force_feedback_feels_its_part_of_the_torque(
    figures_of: Callable[..., Rows],
) -> None:
    [row] = figures_of("20 ms, 5", "--feedback", "0.5")
    assert row["felt"] == pytest.approx(0.5, abs=0.02)
    assert row["stiffness"] == pytest.approx(1.0, rel=0.03)
    assert row["resting"] < 3.0
    assert row["energy"] >= row["tolerance"]


def test_the_gain_of_the_force_feedback_has_the_limit_of_its_damping() -> None:
    laws = load("coupling_laws")
    for delay in (0.001, 0.05, 0.2):
        side = laws.controller(delay, feedback=0.5)
        assert 0.5 < side.feedback.largest_gain[0] < 3.0
    with pytest.raises(ValueError, match="not passive with a delay of 54 ms"):
        laws.controller(0.05, 0.1, feedback=1.0)
    with pytest.raises(ValueError, match=r"with a delay of 0\.3 s: use at most 0\.7"):
        laws.controller(0.3, feedback=2.0)
    with pytest.raises(ValueError, match="must be above 0"):
        laws.controller(0.05, feedback=0.0)


@pytest.mark.parametrize("delay", [-1.0, 3.0, float("nan")])
def test_a_delay_that_no_damping_permits_is_named(delay: float) -> None:
    with pytest.raises(ValueError, match=f"a delay of {delay:g} s in both directions"):
        load("coupling_laws").controller(delay)


@pytest.mark.parametrize("added", [-0.1, 0.5])
def test_an_added_damping_that_oscillates_is_refused(added: float) -> None:
    """With 0.5 s, the coupling has 0.56 N·m·s/rad of 0.75."""
    laws = load("coupling_laws")
    with pytest.raises(ValueError, match=r"added damping of .* use 0 to 0\.18"):
        laws.controller(0.5, added=added)
    laws.controller(0.5, added=0.18)


PLACES = ("--bind", "0.0.0.0:7001", "--remote", "b:7002")


@pytest.mark.parametrize(
    "words", [("leader", "eth0", *PLACES), ("leader", *PLACES, "eth0"), (*PLACES, "leader", "eth0")]
)
def test_the_interface_may_be_before_or_after_the_options(words: tuple[str, ...]) -> None:
    given = load("device").arguments(words)
    assert (given.role, given.target, given.bind) == ("leader", "eth0", "0.0.0.0:7001")
    assert load("device").arguments(("follower", *PLACES)).target is None


@pytest.mark.parametrize(
    ("program", "words", "message"),
    [
        ("device", ("follower", *PLACES, "--feedback", "1"), "is an option of the leader"),
        ("teleoperation", ("--only", "30"), "begins with '30': '0 ms', '20 ms'"),
        ("teleoperation", ("--only", "20 ms, off", "--realtime"), "no network of this mode"),
    ],
)
def test_a_command_line_that_means_nothing_is_refused(
    program: str, words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        load(program).arguments(words)
    assert message in capsys.readouterr().err


def test_the_program_prints_why_the_link_does_not_connect(
    capsys: pytest.CaptureFixture[str],
) -> None:
    peer = SimpleNamespace(state=LinkState.WAITING, reason="no packet")
    report = load("device").Report(peer)
    for k in range(3000):
        peer.reason = f"refused {k}" if k else "no packet"
        report.step(k * 1e-3)
    peer.state, peer.reason = LinkState.CONNECTED, ""
    report.step(2.9995)
    report.step(9.0)
    lines = [line.split(maxsplit=2)[2] for line in capsys.readouterr().out.splitlines()]
    waiting = [f"link waiting refused {k}" for k in (1000, 2000)]
    assert lines == ["link waiting no packet", *waiting, "link connected"]
