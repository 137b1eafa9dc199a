"""Errors of a kernel master: the cause, a command as remedy, and no leftovers."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import (
    CatenaryError,
    ConfigurationError,
    IdentityError,
    LinkError,
    NoDeviceError,
)
from catenary.igh import Master
from catenary.igh import failures as module
from tests.igh.double import Double


@pytest.fixture
def node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Provide a device file and a loaded module."""
    path = tmp_path / "EtherCAT0"
    path.touch()
    sysfs = tmp_path / "ec_master"
    sysfs.mkdir()
    (sysfs / "version").write_text("1.6.2 abc\n")
    monkeypatch.setattr(module, "NODE", str(tmp_path / "EtherCAT{}"))
    monkeypatch.setattr(module, "MODULE", sysfs)
    return path


def refusal(double: Double, number: int = errno.ENOENT) -> str:
    double.absent(number)
    with pytest.raises(LinkError) as caught:
        cat.MainDevice(Master(library=double.path)).open()
    return str(caught.value)


def test_no_module(double: Double, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "NODE", str(tmp_path / "EtherCAT{}"))
    monkeypatch.setattr(module, "MODULE", tmp_path / "ec_master")
    said = refusal(double)
    assert "ec_master is not loaded" in said
    assert "sudo systemctl start ethercat" in said


def test_no_device_file(double: Double, node: Path) -> None:
    node.unlink()
    said = refusal(double)
    assert "is loaded, but" in said
    assert "MASTER0_DEVICE in /etc/ethercat.conf" in said


def test_no_permission(double: Double, node: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module.os, "access", lambda path, mode: False)
    said = refusal(double)
    assert "no permission" in said
    assert "udevadm trigger" in said


def test_no_network_interface(double: Double, node: Path) -> None:
    said = refusal(double, errno.ENODEV)
    assert "waits for its network interface" in said
    assert "MASTER0_DEVICE" in said
    assert "sudo systemctl restart ethercat" in said


def test_a_kernel_that_refuses(double: Double, node: Path) -> None:
    assert "dmesg | tail" in refusal(double, errno.EIO)


def test_library_and_module_of_two_builds(double: Double, node: Path) -> None:
    said = refusal(double)
    assert "(version 1.6.2 abc) do not work together" in said
    assert "ethercat version" in said


def test_a_second_application(double: Double, node: Path) -> None:
    with cat.MainDevice(Master(library=double.path)) as main:
        main.scan()
        with pytest.raises(LinkError, match=r"reserved by another(.|\n)*fuser -v"):
            cat.MainDevice(Master(library=double.path)).open()
    with cat.MainDevice(Master(library=double.path)) as main:
        assert len(main.scan()) == 2


def test_no_devices(double: Double) -> None:
    Double(double.path, slaves=0)
    with (
        pytest.raises(NoDeviceError, match="found no device"),
        cat.MainDevice(Master(library=double.path, virtual_time=True)) as main,
    ):
        main.scan()
    assert double.reserved() == 0


def test_no_link(double: Double) -> None:
    double.cable(0)
    with (
        pytest.raises(LinkError, match="no link"),
        cat.MainDevice(Master(library=double.path, virtual_time=True)) as main,
    ):
        main.scan()
    assert double.reserved() == 0


def test_a_scan_waits_for_the_scan_of_the_master(double: Double) -> None:
    double.scanning(20)
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        assert len(main.scan()) == 2


def test_an_unexpected_number_of_devices(double: Double) -> None:
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        with pytest.raises(IdentityError):
            main.scan(expected=[(0xAA, 0x402), (0xBB, 0x402)])
        with pytest.raises(CatenaryError, match="1 devices expected, 2 found"):
            main.scan(expected=[None])


@pytest.mark.parametrize("call", [b"pdos", b"reg_pdo_entry_pos", b"activate"])
def test_a_failed_configuration_leaves_nothing(double: Double, call: bytes) -> None:
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
        double.fail(call, -errno.ENOMEM)
        with pytest.raises(CatenaryError, match=r"Cannot allocate memory"), cat.Loop(arm):
            pass
        assert double.changes()[-2:] == ["release_master", "request_master 0"]
        double.fail(b"", 0)
        with cat.Loop(arm) as loop:
            assert next(loop).ok
    assert double.reserved() == 0


def test_configuration_after_activation(double: Double) -> None:
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
        plan = main.plan(arm)
        main.configure(plan)
        with pytest.raises(ConfigurationError, match="already activated"):
            main.configure(plan)
        main.leave()
        main.configure(plan)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_nothing_is_left_reserved(double: Double, error: type[BaseException]) -> None:
    def run() -> None:
        with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
            main.scan()
            with cat.Loop(
                cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
            ) as loop:
                next(loop)
                raise error

    with pytest.raises(error):
        run()
    assert double.changes()[-2:] == ["deactivate", "release_master"]
    assert double.reserved() == 0


def test_a_device_lost_before_the_loop_is_named(double: Double) -> None:
    """Its position is empty: the master has found fewer devices since the scan."""
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
        double.online(1, 0)
        with pytest.raises(CatenaryError, match="device 1"), cat.Loop(arm):
            pass
    assert double.reserved() == 0
