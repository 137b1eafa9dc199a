"""Checks of the clocks: the cost of a source, and the largest slew of each daemon."""

from __future__ import annotations

import ctypes
from dataclasses import replace

import pytest

from catenary.doctor.clock_state import Timex, read_clock_state
from catenary.doctor.clocks import SOURCE, slewing, source
from tests.doctor.machines import STEADY, make


def test_the_advice_for_a_slow_source_names_a_fast_one(tmp_path):
    files = {SOURCE: "hpet", SOURCE.replace("current", "available"): "hpet tsc acpi_pm"}
    check = source(make(tmp_path, files))
    assert (check.status, check.advice.split("|")[0]) == ("FAIL", "echo tsc ")


@pytest.mark.parametrize(
    ("daemon", "configuration", "status"),
    [
        ("chronyd", "", "WARN"),  # 83333 ppm by default
        ("chronyd", "# maxslewrate 100", "WARN"),
        ("chronyd", "MaxSlewRate 100.5", "PASS"),
        ("chronyd", "maxslewrate 100\nmaxslewrate 5000", "WARN"),  # the last one counts
        ("systemd-timesyn", "", "PASS"),
        ("phc2sys", "", "WARN"),
        ("bash", "", "PASS"),
    ],
)
def test_the_largest_slew_of_a_daemon(tmp_path, daemon, configuration, status):
    files = {"/proc/9/comm": daemon, "/etc/chrony/chrony.conf": configuration}
    assert slewing(make(tmp_path, files)).status == status


def test_the_current_slew_takes_precedence(tmp_path):
    check = slewing(make(tmp_path, {}, clock=replace(STEADY, slew_ppm=-20_000.0)))
    assert (check.status, "0.980000 ms" in check.found) == ("WARN", True)


def test_the_clock_state_of_this_kernel():
    state = read_clock_state()
    assert state is not None
    assert abs(state.slew_ppm) < 200_000
    assert 0 < state.resolution < 1


def test_the_structure_is_at_least_as_long_as_the_kernels():
    # linux/timex.h, 64 bits: 208 bytes; tick follows time, at 88
    assert ctypes.sizeof(Timex) >= 208
    if ctypes.sizeof(ctypes.c_long) == 8:
        assert Timex.tick.offset == 88
