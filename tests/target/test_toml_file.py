"""A machine file as the name of a segment."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import ConfigurationError, MachineFileError
from catenary.igh import Master
from catenary.link import Interface, Ring
from catenary.target import MainDevice, is_machine_file, parse
from catenary.target.toml_file import read_toml
from catenary.virtual import Segment


def named(folder: Path, target: str) -> str:
    """Write a machine file with a target. Return its path."""
    path = folder / "machine.toml"
    path.write_text(f'target = "{target}"\n')
    return str(path)


def test_the_target_in_the_file_is_parsed(tmp_path: Path) -> None:
    assert parse(named(tmp_path, "eth0")) == Interface("eth0")
    assert parse(named(tmp_path, "eth0,eth1")) == Ring(Interface("eth0"), Interface("eth1"))
    assert isinstance(parse(named(tmp_path, "igh:0")), Master)
    assert isinstance(parse(named(tmp_path, "virtual")), Segment)


def test_the_path_of_a_segment_is_relative_to_the_machine_file(tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text('[[device]]\nkind = "coupler"\n')
    with MainDevice(named(tmp_path, "virtual:line.toml")) as main:
        assert len(main.scan()) == 1


def test_the_suffix_identifies_a_machine_file() -> None:
    assert is_machine_file("cell/machine.toml")
    assert not is_machine_file("virtual:line.toml")
    assert not is_machine_file("eth0")


@pytest.mark.parametrize("target", ["other.toml", "", " ", "two words", "virtual:"])
def test_an_invalid_target_is_refused(target: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"target|is not"):
        parse(named(tmp_path, target))


def test_another_machine_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MachineFileError, match="is another machine file"):
        parse(named(tmp_path, "machine.toml"))


def test_a_target_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_text("target = 3\n")
    with pytest.raises(MachineFileError, match="target = 3 is not text"):
        parse(str(path))


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("<?xml version='1.0'?><EtherCATConfig/>", "convert an ENI with `catenary init bus.xml"),
        ("a = " + "x" * 10_000, "the line is: a = x"),
    ],
)
def test_the_hint_about_another_file_is_short(tmp_path: Path, text: str, hint: str) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(text)
    with pytest.raises(MachineFileError, match="not TOML") as caught:
        read_toml(path)
    assert hint in caught.value.hint
    assert len(caught.value.hint) < 250
