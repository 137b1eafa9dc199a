"""What holds for the double, on a real master: CATENARY_IGH=0 names it. Nothing is enabled.

In CI and on machines without the kernel module the double stands in, so that this file is tried.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import LinkError
from catenary.igh import Master
from tests.igh.double import Double


@pytest.fixture
def master(doubles: dict[str, Path]) -> Master:
    number = os.environ.get("CATENARY_IGH")
    if number is not None:
        return Master(int(number))
    return Master(library=Double(doubles["1.6.1"]).path)


def test_devices_are_found(master: Master) -> None:
    with cat.MainDevice(master) as main:
        subs = main.scan()
        assert len(subs) > 0
        for sub in subs:
            assert sub.identity.vendor
            assert sub.read_state().state is not None
        assert [sub.identity for sub in main.scan()] == [sub.identity for sub in subs]


def test_a_loop_reaches_op_and_leaves_nothing(master: Master) -> None:
    for _ in range(2):  # the second time shows that nothing was left of the first
        with cat.MainDevice(master) as main:
            subs = main.scan()
            wishes = [cat.Inputs(sub) for sub in subs if sub.description.inputs]
            with cat.Loop(*wishes, period=2e-3, enable=False, priority=None) as loop:
                good = sum(next(loop).ok for _ in range(200))
                assert good > 100
                assert all(sub.state == 8 for sub in subs)


def test_a_second_application_is_refused(master: Master) -> None:
    with cat.MainDevice(master), pytest.raises(LinkError, match="reserved by another"):
        cat.MainDevice(master).open()
