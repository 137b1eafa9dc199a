"""Forked children of a program that has reserved a kernel master."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

import catenary as cat
from catenary.igh import Master
from tests.igh.double import Double


def in_child(check: Callable[[], bool]) -> bool:
    child = os.fork()
    if child == 0:
        try:
            good = check()
        except BaseException:
            os._exit(2)
        os._exit(0 if good else 1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_a_child_closes_its_copies_and_sends_nothing(double: Double, run: str) -> None:
    """libethercat has one descriptor. The kernel releases the master with its last copy."""

    def forgotten() -> bool:
        double.forget()
        loop.__exit__(None, None, None)
        main.__exit__(None, None, None)
        with pytest.raises(RuntimeError, match="forked child"):
            main.scan()
        return double.calls() == []

    def released() -> bool:
        return double.calls()[-1] == "release_master"

    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=1000, velocity_limit=100.0)
        with cat.Loop(arm, execution=run) as loop:
            next(loop)
            double.forget()
            assert in_child(released)
            assert in_child(forgotten)
            assert "release_master" not in double.calls()
            next(loop)
            assert arm.enabled.all()
