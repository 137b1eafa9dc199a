"""`catenary completion`: the scripts in a real bash, and their syntax in zsh."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from catenary.cli.completion import script
from catenary.cli.main import main, make_parser
from catenary.share import folder
from tests.remote.programs import program

COMPLETE = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_shtab_catenary
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def bash_script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("completion") / "catenary.bash"
    path.write_text(script("bash", make_parser()))
    return path


def complete(script: Path, line: str, folder: Path) -> list[str]:
    """Return the words that bash offers for the last word of a line."""
    command = ["bash", "-c", COMPLETE, "bash", str(script), *line.split(" ")]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=True, timeout=20
    )
    return done.stdout.split("\n")[:-1]


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("catenary sc", ["scan"]),
        ("catenary sdo ", ["read", "write", "list"]),
        ("catenary sdo read virtual 2 0x1018 --ty", ["--type"]),
        ("catenary sdo read virtual 2 0x1018 --type UD", ["UDINT"]),
        ("catenary state virtual PRE", ["PREOP"]),
        ("catenary sii build drive.xml --pdos un", ["unnamed"]),
        ("catenary completion ", ["bash", "zsh"]),
        ("catenary scan virtual-", ["virtual-realtime"]),
        ("catenary doctor l", ["lo"]),
        ("catenary check mach", ["machine.toml"]),
        ("catenary sii show dr", ["drive.bin"]),
        ("catenary scan --json mach", ["machine.toml"]),
    ],
)
def test_bash_offers(bash_script: Path, line: str, offered: list[str], tmp_path: Path) -> None:
    for name in ("machine.toml", "drive.bin"):
        (tmp_path / name).touch()
    assert complete(bash_script, line, tmp_path) == offered


def test_bash_offers_interfaces_and_files_as_targets(bash_script: Path, tmp_path: Path) -> None:
    (tmp_path / "machine.toml").touch()
    found = complete(bash_script, "catenary scan ", tmp_path)
    interfaces = set(os.listdir("/sys/class/net"))
    assert interfaces | {"virtual", "virtual-realtime", "machine.toml"} == set(found)


def test_bash_offers_the_shares_of_the_user(bash_script: Path, tmp_path: Path) -> None:
    if folder.own_folder() != Path(f"/dev/shm/catenary-{os.getuid()}"):
        pytest.skip("the shares of this user are in another user namespace, or of a group")
    with program() as running:
        assert running.name in complete(bash_script, "catenary data ", tmp_path)


def test_a_name_that_is_shell_code_is_not_run(bash_script: Path, tmp_path: Path) -> None:
    """Other users may create files in a shared folder, and bash expands words."""
    bad = tmp_path / "bash"
    listed = "find() { printf '%s\\n' '/x/share-$(id>found)' '/x/share-`id>found`' /x/share-arm; }"
    bad.write_text(f"{bash_script.read_text()}\n{listed}\n")
    assert complete(bad, "catenary data ", tmp_path) == ["arm"]
    assert not (tmp_path / "found").exists()


@pytest.mark.skipif(shutil.which("zsh") is None, reason="needs zsh")
def test_zsh_accepts_the_script(tmp_path: Path) -> None:
    path = tmp_path / "_catenary"
    path.write_text(script("zsh", make_parser()))
    load = f'autoload -Uz compinit; compinit -D -d {tmp_path}/dump; eval "$(<{path})"'
    check = "print -l ${(k)functions[(I)_catenary_*|_shtab_catenary_sdo_read]}"
    done = subprocess.run(
        ["zsh", "-f", "-c", f"{load}; {check}"], capture_output=True, text=True, timeout=20
    )
    assert done.stderr == ""
    assert {"_catenary_targets", "_catenary_list_targets"} <= set(done.stdout.split())


def test_every_command_is_completed(capsys: pytest.CaptureFixture[str]) -> None:
    from catenary.cli.main import COMMANDS

    assert main(["completion", "bash"]) == 0
    text = capsys.readouterr().out
    names = [module.__name__.rpartition(".")[2] for module in COMMANDS]
    assert f"_shtab_catenary_subparsers=({' '.join(names)})" in text


def test_a_missing_package_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "bash"]) == 1
    assert "pip install 'catenary[completion]'" in capsys.readouterr().err
