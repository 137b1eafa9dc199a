"""Tests for every kernel master: the doubles, and with CATENARY_IGH=0 the real one.

Drives of a real one are enabled only with CATENARY_IGH_MOVE=1 (tests/igh/subject.py).
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.errors import ConfigurationError, LinkError, SdoAbort
from catenary.igh import Reservation, SubDevice
from catenary.pyigh import MasterBase, SlaveIO
from catenary.types import UDINT
from tests.igh.loops import kernel_of
from tests.igh.subject import PATIENCE, REAL, Subject, doubled, real, until

RELEASES = ["1.5.2", "1.5.3", "1.6-alpha", "1.6.1"]


@pytest.fixture(params=["real"] if REAL is not None else RELEASES)
def subject(request: pytest.FixtureRequest) -> Subject:
    if request.param == "real":  # needs no compiler
        return real()
    return doubled(request.getfixturevalue("doubles")[request.param])


@pytest.fixture
def main(subject: Subject) -> Iterator[cat.MainDevice]:
    with subject.open() as main:
        main.scan()
        yield main


def talker(main: cat.MainDevice) -> SubDevice:
    """Return the first device with objects."""
    found = next((sub for sub in main.subs if sub.description.coe), None)
    if found is None:
        pytest.skip("no device with objects on this segment")
    assert isinstance(found, SubDevice)
    return found


def drives(main: cat.MainDevice) -> list[cat.SubDevice]:
    if not main.subs.drives:
        pytest.skip("no drives on this segment")
    return list(main.subs.drives)


def test_devices_are_found(main: cat.MainDevice) -> None:
    subs = main.subs
    assert len(subs) > 0
    for sub in subs:
        assert sub.identity.vendor
        assert str(sub.read_state().state) == "PRE-OP"
    again = main.scan()
    assert [sub.identity for sub in again] == [sub.identity for sub in subs]
    assert all(one is other for one, other in zip(subs, again, strict=True))


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_a_loop_reaches_op_and_can_be_repeated(subject: Subject, run: str) -> None:
    for _ in range(2):  # the second loop shows that the first one left nothing behind
        with subject.open() as main:
            main.scan()
            with subject.loop(*subject.inputs(main), execution=run) as loop:
                good = sum(next(loop).ok for _ in range(200))
                assert good > 100
                assert all(sub.state == 8 for sub in main.subs)
            assert all(str(sub.state) == "PRE-OP" for sub in main.subs)


def test_a_second_application_is_refused(subject: Subject) -> None:
    with subject.open(), pytest.raises(LinkError, match="reserved by another"):
        subject.open().open()
    with subject.open() as main:
        assert len(main.scan()) > 0


def test_nothing_can_be_configured_after_activation(subject: Subject, main: cat.MainDevice) -> None:
    plan = main.plan(*subject.inputs(main), period=subject.period)
    main.configure(plan)
    with pytest.raises(ConfigurationError, match="already activated"):
        main.configure(plan)
    with pytest.raises(ConfigurationError, match="only while cycles run"):
        talker(main).sdo.read(0x1018, 1)
    main.leave()
    assert talker(main).sdo.read(0x1018, 1, type=UDINT) == talker(main).identity.vendor


def test_an_error_leaves_nothing_reserved(subject: Subject) -> None:
    def run() -> None:
        with subject.open() as main:
            main.scan()
            with subject.loop(*subject.inputs(main)) as loop:
                next(loop)
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run()
    with subject.open() as main:
        assert len(main.scan()) > 0


def test_objects_before_a_loop(main: cat.MainDevice) -> None:
    sub = talker(main)
    assert sub.sdo.read(0x1018, 1, type=UDINT) == sub.identity.vendor
    with pytest.raises(SdoAbort) as caught:
        sub.sdo.read(0x0FFF, 0)
    assert caught.value.code == 0x06020000


def test_objects_in_operation(subject: Subject, main: cat.MainDevice) -> None:
    """Objects are read by a request, by a call if the request is refused, and written."""
    sub = talker(main)
    with subject.loop(*subject.inputs(main)) as loop:
        next(loop)
        answers = [sub.sdo.request(0x1018, 1, type=UDINT), sub.sdo.request(0x1000, type=UDINT)]
        refused = [sub.sdo.request(0x0FFF), sub.sdo.request_write(0x0FFF, 0, b"\0\0")]
        until(loop, lambda: all(each.done for each in (*answers, *refused)))
        assert answers[0].result() == sub.identity.vendor
        answers[1].result()
        for each in refused:
            with pytest.raises(SdoAbort, match="0x06020000"):
                each.result()


def test_registers_in_operation(subject: Subject, main: cat.MainDevice) -> None:
    sub = talker(main)
    with subject.loop(*subject.inputs(main)) as loop:
        next(loop)
        asked = main.request(sub.read_register(0x0012, 2))  # the alias
        until(loop, lambda: asked.done)
        assert len(asked.result()) == 2


@pytest.mark.parametrize("clock", ["main", "reference"])
def test_the_figures_of_the_clocks(subject: Subject, main: cat.MainDevice, clock: str) -> None:
    """All followers report differences, and the reference its time; their size is not checked."""
    clocked = [sub for sub in drives(main) if sub.description.clock_bits]
    if not clocked:
        pytest.skip("no drive with distributed clocks")
    arm = cat.Drives(clocked, counts_per_turn=2**20, velocity_limit=100.0, dc=True)
    with subject.loop(arm, lead=clock) as loop:
        clocks = loop.clocks
        until(loop, lambda: not any(math.isnan(d) for d in clocks.differences.values()))
        assert clocks.reference in main.subs
        assert clocks.time > 0
        assert f"reference: device {clocks.reference.position}" in str(clocks)
        assert kernel_of(main).configuration.exchange.figures["clock_reads"] > 0  # type: ignore[attr-defined]


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_drives_follow(subject: Subject, main: cat.MainDevice, run: str) -> None:
    if not subject.may_move:
        pytest.skip("nothing moves without CATENARY_IGH_MOVE=1")
    arm = cat.Drives(drives(main), counts_per_turn=2**20, velocity_limit=100.0)
    with subject.loop(arm, execution=run, enable=True) as loop:
        assert arm.enabled.all()
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 0.1 * min(1.0, cycle.number / 200)
            if cycle.number >= 260:
                break
        np.testing.assert_allclose(arm.actual.position, home + 0.1, atol=0.02)


def test_another_thread_reads_objects_while_the_loop_runs(subject: Subject) -> None:
    with subject.open() as main:
        main.scan()
        sub = talker(main)
        if isinstance(main.link, Reservation) and main.link.time.is_virtual:
            pytest.skip("in virtual time there is one thread")
        found: list[int] = []
        asking = threading.Thread(target=lambda: found.append(sub.sdo.read(0x1018, 1, type=UDINT)))
        with subject.loop(*subject.inputs(main)) as loop:
            next(loop)
            asking.start()
            until(loop, lambda: bool(found))
            asking.join()
        assert found == [sub.identity.vendor]


def test_the_interface_of_pyigh(subject: Subject) -> None:
    with MasterBase(subject.make(), period=subject.period) as master:
        slave = SlaveIO(next(sub.position for sub in master.main.subs if sub.description.inputs))
        master.ecat_init_slave(slave)
        master.ecat_activate_domain()
        master.ecat_activate_master()
        for _ in range(PATIENCE):
            master.wait()
            master.ecat_master_receive()
            complete = master.ecat_domain_process()
            master.ecat_domain_queue()
            master.ecat_write_apptime(master.main.link.now())
            master.ecat_master_send()
            if complete and master.ecat_slave_config_state(slave) == (True, True, 8):
                break
        else:
            raise AssertionError(f"{master.ecat_slave_config_state(slave)}")
        status = master.ecat_master_status()
        assert status.slaves_responding == len(master.main.subs)
        assert status.link_up


@pytest.mark.skipif(REAL is not None, reason="this is what it starts")
def test_the_switch_for_the_real_master_works(doubles: dict[str, Path]) -> None:
    """CATENARY_IGH=0 uses any library that is found; here it is the double."""
    environment = {
        **os.environ,
        "CATENARY_IGH": "0",
        "CATENARY_LIBETHERCAT": str(doubles["1.6.1"]),
        "DOUBLE_SLAVES": "2",
    }
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "real", __file__],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "passed" in done.stdout
    assert "skipped" in done.stdout  # without permission, drives do not move
