"""Scans with the data of the kernel master."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.errors import CatenaryError, MailboxError
from catenary.igh import Master
from tests.igh.double import Double


def test_a_scan_waits_for_devices_on_the_way_to_pre_op(double: Double) -> None:
    """In INIT, devices do not answer SDOs, and would look like devices without objects."""
    double.boot(12)
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        subs = main.scan()
        assert [str(sub.state) for sub in subs] == ["PRE-OP", "PRE-OP"]
        assert all(sub.is_drive for sub in subs)


def test_a_device_that_stays_in_op_does_not_block_a_scan(double: Double) -> None:
    """Devices with Ethernet over EtherCAT do so."""
    double.state(1, 8, 0)
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        begun = main.link.now()
        assert [str(sub.state) for sub in main.scan()] == ["PRE-OP", "OP"]
        assert (main.link.now() - begun) * 1e-9 < 3.0


def test_an_upload_with_a_lost_answer_is_repeated(double: Double) -> None:
    """Otherwise, a drive whose answer was lost would look like a device without objects.

    This was observed on a real master.
    """
    double.silent(2)
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        assert all(sub.is_drive for sub in main.scan())
        double.silent(100)
        with pytest.raises(MailboxError, match="0x1000:00: no answer"):
            main.scan()


def test_no_objects_are_read_from_a_terminal_without_a_mailbox(double: Double) -> None:
    """libethercat and the kernel would report an error, on stderr and in the log."""
    double.plain(1)
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        drive, terminal = main.scan()
        assert (drive.description.coe, terminal.description.coe) == (True, False)
        assert terminal.description.outputs[0].sync_manager == 0
    assert not any(call.startswith("sdo_upload 1 ") for call in double.calls())


def test_devices_with_latched_receive_times_have_clocks(double: Double) -> None:
    double.clockless(0)
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        first, second = main.scan()
        assert (first.description.clock_bits, second.description.clock_bits) == (0, 64)
        with pytest.raises(CatenaryError, match="device 0"):
            main.plan(cat.Drives([first], counts_per_turn=1000, velocity_limit=100.0, dc=True))
        with cat.Loop(
            cat.Drives([second], counts_per_turn=1000, velocity_limit=100.0, dc=True)
        ) as loop:
            assert loop.clocks.reference is second
    assert "select_reference_clock 1" in double.calls()
