"""AL status codes from the kernel's log."""

from __future__ import annotations

from pathlib import Path

from catenary.igh.kernel_log import KernelLog

# printed by the module 1.6.1: EC_SLAVE_ERR in master/slave.h, ec_fsm_change_state_code
LINES = """\
3,1200,61234567,-;EtherCAT ERROR 0-1: AL status message 0x001B: "Sync manager watchdog".
3,1201,61234570,-;EtherCAT ERROR 0-12: AL status message 0x0030: "Invalid DC SYNC Configuration".
3,1202,61234571,-;EtherCAT ERROR 1-1: Unknown AL status code 0x8123.
"""


def test_the_last_code_of_a_device_is_returned(tmp_path: Path) -> None:
    file = tmp_path / "kmsg"
    file.write_text('3,1,1,-;EtherCAT ERROR 0-1: AL status message 0x0011: "before".\n')
    log = KernelLog(str(file))
    assert log.status_code(0, 1) == 0  # of an earlier loop
    with file.open("a") as more:
        more.write(LINES)
    assert log.status_code(0, 1) == 0x001B
    assert log.status_code(0, 12) == 0x0030
    assert log.status_code(1, 1) == 0x8123
    assert log.status_code(0, 2) == 0
    log.close()
    assert log.status_code(0, 1) == 0x001B


def test_an_unreadable_log_returns_no_code(tmp_path: Path) -> None:
    log = KernelLog(str(tmp_path / "none"))
    assert log.status_code(0, 0) == 0
    log.close()
