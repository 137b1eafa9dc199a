"""0x1C32:01 and 0x1C33:01: restored after a loop with clocks, or an error with the reason."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.igh import kernel_cycle
from catenary.igh.kernel_log import KernelLog
from tests.igh.double import Double
from tests.igh.loops import clocked_loop


def test_the_types_are_restored_after_a_loop_with_clocks(
    main: cat.MainDevice, double: Double
) -> None:
    """Otherwise, the devices would wait for SYNC0 in the next program without clocks.

    This was observed on a real master, with AL status 0x0030.
    """
    with clocked_loop(main):
        assert double.value(0, 0x1C32, 1) == 2
    assert double.value(0, 0x1C32, 1) == 1
    with cat.Loop(cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)) as loop:
        assert next(loop).ok


def test_types_are_restored_once_devices_are_in_pre_op(
    main: cat.MainDevice, double: Double
) -> None:
    """The master brings them down after its deactivation. In OP, they refuse 0x1C32."""
    double.linger(20)
    with clocked_loop(main):
        assert double.value(1, 0x1C32, 1) == 2
    assert [double.value(p, 0x1C32, 1) for p in (0, 1)] == [1, 1]
    assert all(str(sub.state) == "PRE-OP" for sub in main.subs)


def test_a_device_may_take_seconds_to_reach_pre_op(main: cat.MainDevice, double: Double) -> None:
    """The master repeats a lost INIT request after 5 s (seen on a real master)."""
    double.linger(500)  # a check takes 10 ms
    with clocked_loop(main):
        pass
    assert [double.value(p, 0x1C32, 1) for p in (0, 1)] == [1, 1]


def test_a_type_that_cannot_be_restored_is_an_error(main: cat.MainDevice, double: Double) -> None:
    def run() -> None:
        with clocked_loop(main):
            double.refuse(0x06090030)

    with pytest.raises(cat.errors.SdoAbort, match="0x06090030") as caught:
        run()
    assert "ethercat download -p 0 -t uint16 0x1C32 1 1" in caught.value.hint
    assert any("device 1" in note for note in caught.value.__notes__)


def test_a_device_that_stays_in_op_is_an_error(main: cat.MainDevice, double: Double) -> None:
    def run() -> None:
        with clocked_loop(main):
            double.linger(1_000_000)

    with pytest.raises(cat.errors.StateError, match=r"device 0 is not in PRE-OP but in OP.*0x1C32"):
        run()
    assert all(str(sub.state) == "OP" for sub in main.subs)  # as read from the device
    double.linger(0)
    double.state(0, 2, 0)
    double.state(1, 2, 0)
    with cat.Loop(cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)):
        assert double.value(0, 0x1C32, 1) == 1  # restored later


def test_the_types_are_restored_after_a_failed_configuration(
    main: cat.MainDevice, double: Double
) -> None:
    double.fail(b"activate", -5)
    with pytest.raises(cat.CatenaryError, match="activat"), clocked_loop(main):
        pass
    assert [double.value(p, 0x1C32, 1) for p in (0, 1)] == [1, 1]


def test_a_cleared_code_is_read_from_the_kernel_log(
    main: cat.MainDevice, double: Double, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The master acknowledges an error, and the device clears its AL status code."""
    log = tmp_path / "kmsg"
    log.touch()
    monkeypatch.setattr(kernel_cycle, "KernelLog", lambda: KernelLog(str(log)))

    def run() -> None:
        with clocked_loop(main) as loop:
            double.state(1, 4, 1)
            text = '3,1,1,-;EtherCAT ERROR 0-1: AL status message 0x0032: "DC PLL Sync Error".'
            log.write_text(text)
            for _ in range(100):
                next(loop)

    with pytest.raises(cat.errors.StateError, match="0x0032: PLL error") as caught:
        run()
    assert caught.value.position == 1


def test_the_error_names_a_leftover_type(main: cat.MainDevice, double: Double) -> None:
    """A program that was killed wrote 2 into 0x1C32:01: AL status code 0x0030."""
    double.set(0, 0x1C32, 1, 2)
    double.register(0, 0x0134, 0x0030)
    plain = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
    double.state(0, 2, 1)
    with pytest.raises(cat.errors.StateError, match="0x0030") as caught, cat.Loop(plain):
        pass
    assert "0x1C32:01 is 2" in caught.value.hint
    assert "ethercat download -p 0" in caught.value.hint
