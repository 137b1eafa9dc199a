"""Names of segments."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import CatenaryError, ConfigurationError
from catenary.igh import Master
from catenary.link import Interface, Ring
from catenary.target import MainDevice, parse
from catenary.target.parse import in_virtual_time
from catenary.virtual import Coupler, Segment


def test_a_network_interface() -> None:
    assert parse("eth0") == Interface("eth0")
    assert parse("enp3s0.2") == Interface("enp3s0.2")


def test_virtual_is_a_new_demo_segment_each_time() -> None:
    first, second = parse("virtual"), parse("virtual")
    assert isinstance(first, Segment)
    assert len(first) == 6
    assert first is not second


def test_virtual_with_a_file(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text('[[device]]\nkind = "coupler"\n')
    segment = parse(f"virtual:{file}")
    assert isinstance(segment, Segment)
    assert len(segment) == 1


@pytest.mark.parametrize(
    ("target", "clock"), [("virtual", "virtual"), ("virtual-realtime", "monotonic")]
)
def test_a_virtual_segment_on_the_clock_of_the_machine(
    target: str, clock: str, tmp_path: Path
) -> None:
    file = tmp_path / "cell.toml"
    file.write_text('[[device]]\nkind = "coupler"\n')
    for source in (parse(target), parse(f"{target}:{file}")):
        assert isinstance(source, Segment)
        assert source.clock == clock
    assert in_virtual_time(target) is (clock == "virtual")
    assert not in_virtual_time("eth0")


def test_a_missing_file_is_named() -> None:
    with pytest.raises(CatenaryError, match="no_such_file"):
        parse("virtual:no_such_file.toml")


@pytest.mark.parametrize("target", ["", " ", "virtual:", "eth0:1", "a b", "dev/eth0"])
def test_an_invalid_target_is_refused(target: str) -> None:
    with pytest.raises(ConfigurationError, match="invalid target"):
        parse(target)


def test_the_number_of_an_igh_master_is_required() -> None:
    source = parse("igh:1")
    assert isinstance(source, Master)
    assert source.index == 1
    with pytest.raises(ConfigurationError, match="number of the IgH master is missing"):
        parse("igh:eth0")


def test_a_ring_of_two_interfaces() -> None:
    assert parse("eth0,eth1") == Ring(Interface("eth0"), Interface("eth1"))


@pytest.mark.parametrize("target", ["eth0,eth0", "eth0,eth1,eth2", "eth0,virtual:x.toml"])
def test_an_invalid_ring_is_refused(target: str) -> None:
    with pytest.raises(CatenaryError, match=r"ring|x\.toml"):
        parse(target)


def test_a_main_device_accepts_a_name_or_a_source() -> None:
    with MainDevice("virtual") as main:
        assert len(main.scan()) == 6
    with MainDevice(Segment([Coupler()])) as main:
        assert len(main.scan()) == 1


def test_an_xml_file_is_not_a_segment() -> None:
    with pytest.raises(ConfigurationError, match=r"'bus\.xml' is an XML file") as caught:
        parse("bus.xml")
    assert "cat.Machine" in caught.value.hint
