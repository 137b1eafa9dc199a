"""Command line of `catenary dashboard`."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.cli import dashboard
from catenary.cli.failure import UsageError
from catenary.cli.main import main, make_parser
from tests.share.processes import comes_true


def test_help_names_the_safety_limit(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["dashboard", "--help"])
    assert ended.value.code == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "not an emergency stop (ISO 13850)" in text
    assert "--viewer-only" in text


@pytest.mark.parametrize("port", ["-1", "65536", "x"])
def test_an_impossible_port_is_refused(port: str) -> None:
    with pytest.raises(SystemExit) as ended:
        make_parser().parse_args(["dashboard", "arm", "--port", port])
    assert ended.value.code == 2


@pytest.mark.parametrize(
    ("source", "answer"),
    [
        ("virtual", True),
        ("virtual:cell.toml", True),
        ("machine.toml", True),
        ("igh:0", True),
        ("eth0,eth1", True),
        ("lo", True),
        ("no-such-share", False),
        ("share:virtual", False),
    ],
)
def test_targets_and_shares(source: str, answer: bool) -> None:
    assert dashboard.is_target(source) == answer


def test_an_existing_share_precedes_an_interface(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.dashboard.source.names", lambda uid: ["lo"])
    assert not dashboard.is_target("lo")


def test_the_only_share_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.dashboard.source.names", lambda uid: ["arm"])
    assert dashboard.only_share(None) == "arm"


@pytest.mark.parametrize(("names", "text"), [([], "there is none"), (["a", "b"], "several: a, b")])
def test_without_one_share_the_name_is_needed(
    names: list[str], text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("catenary.dashboard.source.names", lambda uid: names)
    with pytest.raises(UsageError, match=text):
        dashboard.only_share(None)


def test_a_moving_base_needs_a_model() -> None:
    arguments = make_parser().parse_args(["dashboard", "upper", "--base", "robot.base"])
    with pytest.raises(UsageError, match="--base needs --model"):
        dashboard.check_paths(arguments)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["upper", "--also", "a/b"], "--also: invalid name 'a/b'"),
        (["upper", "--base", "upper", "--model", __file__], "--base upper: this share has axes"),
        (["upper", "--also", ""], "--also: invalid name ''"),
        (["share:a/b"], "SHARE: invalid name 'a/b'"),
        (["upper", "--also", "lower", "--also", "lower"], "--also lower: the page already"),
        (["share:upper", "--also", "share:upper"], "--also upper: the page already"),
    ],
)
def test_invalid_and_repeated_shares_are_refused(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("starlette")
    assert main(["dashboard", *words]) == 2
    assert said in capsys.readouterr().err


def test_further_shares_reach_the_server_and_missing_ones_are_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("starlette")
    from catenary.dashboard import server

    found: list[server.Options] = []
    model = tmp_path / "robot.xml"
    model.write_text("<mujoco/>")
    monkeypatch.setattr(
        server, "run_server", lambda share, options, announce: found.append(options)
    )
    monkeypatch.setattr("catenary.dashboard.source.names", lambda uid: ["upper"])
    words = [
        "dashboard",
        "upper",
        "--also",
        "share:lower",
        "--also",
        "hand",
        "--base",
        "robot.base",
    ]
    assert main([*words, "--model", str(model)]) == 0
    (options,) = found
    assert (options.panels.also, options.panels.base) == (("lower", "hand"), "robot.base")
    noted = capsys.readouterr().err
    assert [
        name for name in ("upper", "lower", "hand", "robot.base") if f"'{name}' yet" in noted
    ] == [
        "lower",
        "hand",
        "robot.base",
    ]


@pytest.mark.parametrize(
    "words",
    [["arm", "--model", "none.xml"], ["arm", "--recordings", "none"], ["none.toml"]],
)
def test_a_missing_file_is_refused(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=r"there is no (file|folder) none"):
        dashboard.check_paths(make_parser().parse_args(["dashboard", *words]))


def test_a_share_that_does_not_exist_is_noted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("catenary.dashboard.source.names", lambda uid: ["arm"])
    dashboard.note_missing("arm", None)
    assert capsys.readouterr().err == ""
    dashboard.note_missing("amr", None)
    assert "no share 'amr' yet; existing shares: 'arm'" in capsys.readouterr().err


def test_a_window_needs_chromium(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(UsageError, match="Chromium"):
        dashboard.Announcer(window=True)


def test_a_window_receives_the_token_in_a_private_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """All users of the machine can read the arguments of a process."""
    pytest.importorskip("starlette")
    from catenary.dashboard.security import Access

    started: list[list[str]] = []
    monkeypatch.setattr("shutil.which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr("subprocess.Popen", lambda c, **_: started.append(c))
    monkeypatch.setattr("catenary.dashboard.server.key_folder", lambda: tmp_path)
    access = Access(bytes(32), host="127.0.0.1", port=8710)
    for _ in range(2):  # a second server replaces the file
        dashboard.Announcer(window=True)(access)
    file = tmp_path / "dashboard-8710.html"
    assert started[-1] == ["/usr/bin/chromium", f"--app=file://{file}"]
    assert file.stat().st_mode & 0o777 == 0o600
    assert f"#token={access.token('operator')}" in file.read_text()


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_server_with_status_0(kind: signal.Signals, tmp_path: Path) -> None:
    pytest.importorskip("starlette")
    command = [sys.executable, "-m", "catenary.cli", "dashboard", "no-such-share", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        assert server.stdout.readline().startswith("operator: http://127.0.0.1:")
        server.send_signal(kind)
        assert server.wait(30) == 0


def test_the_program_of_a_target_ends_with_a_killed_server() -> None:
    pytest.importorskip("starlette")
    command = [sys.executable, "-m", "catenary.cli", "dashboard", "virtual", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            assert server.stdout.readline().startswith("operator: ")
            with cat.attach(f"dashboard-{server.pid}", patience=patience()) as reader:
                server.kill()
                assert comes_true(lambda: reader.state == "ended")
        finally:
            server.kill()


def patience() -> Iterator[None]:
    """Yield for a minute."""
    for _ in range(600):
        time.sleep(0.1)
        yield
