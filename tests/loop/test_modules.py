"""A modular device in a loop: its modules are compared, written and moved."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.virtual import Segment
from tests.loop.axis_block import BOTH, CSP, CSV, FILE, AxisBlock, LateBlock


@contextmanager
def opened(shared_data: Path, model: AxisBlock) -> Iterator[tuple[cat.MainDevice, cat.SubDevice]]:
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan(esi=shared_data / "esi" / FILE)
        yield main, sub


def test_the_reported_modules_are_used(shared_data: Path) -> None:
    with opened(shared_data, AxisBlock(shared_data, [CSP, BOTH])) as (main, sub):
        assert sub.slots == (0, 1)
        text = str(main.plan(cat.ProcessData(sub), period=1e-3))
        assert "modules reported in 0xF050" in text
        assert "slot 1 (Axis 1): csv,csp - axis (0x00119800), PDOs 0x1610, 0x1A10" in text
        assert f"{FILE}:1463" in text
        assert "0xF030  0x00319800, 0x00000000 → 0x00219800, 0x00119800" in text


def test_the_axes_of_two_slots_move(shared_data: Path) -> None:
    model = AxisBlock(shared_data, [BOTH, CSP])
    with opened(shared_data, model) as (_, sub):
        arm = cat.Drives([sub], modules=[BOTH, CSP], counts_per_turn=2**20, velocity_limit=9.0)
        assert len(arm) == 2
        with cat.Loop(arm, period=2e-3) as loop:
            start = arm.actual.position.copy()
            for _, count in zip(loop, range(200), strict=False):
                arm.target.position[:] = start + np.multiply(count, [0.001, -0.002])
            assert arm.enabled.all()
            assert arm.actual.position - start == pytest.approx([0.19, -0.39], abs=0.03)
        assert model.application.module_lists is not None
        assert model.application.module_lists.configured == [0x119800, 0x219800]
        assert model.read_object(0x6860) == b"\x08"  # its command of the step to OP


def test_another_module_stops_before_anything_is_written(shared_data: Path) -> None:
    model = AxisBlock(shared_data, [BOTH, CSP])
    with opened(shared_data, model) as (_, sub):
        data = cat.ProcessData(sub, modules=[BOTH, CSV])
        expected = r"slot 1 \(Axis 1\): expected csv -  ?axis \(0x00319800\), found csp - axis"
        with pytest.raises(ConfigurationError, match=expected), cat.Loop(data, period=2e-3):
            pass
        assert model.application.module_lists is not None
        assert model.application.module_lists.configured == [CSV, 0]


def test_a_request_for_the_present_modules_keeps_the_mapping(shared_data: Path) -> None:
    with opened(shared_data, AxisBlock(shared_data, [CSV])) as (main, sub):
        plan = main.plan(cat.ProcessData(sub, modules=[CSV]), period=1e-3)
        assert plan.devices[0].modules is not None
        assert plan.devices[0].modules.downloads == ()
        assert plan.devices[0].mapping == ()
        assert plan.devices[0].mapping_source == "CoE"


def test_two_requests_for_one_device_need_the_same_modules(shared_data: Path) -> None:
    with opened(shared_data, AxisBlock(shared_data, [BOTH, CSP])) as (main, sub):
        one = cat.ProcessData(sub, modules=[BOTH, CSP], outputs={})
        other = cat.ProcessData(sub, modules=[BOTH])
        with pytest.raises(ConfigurationError, match="different modules in its slots"):
            main.plan(one, other, period=1e-3)


def test_modules_need_an_esi(shared_data: Path) -> None:
    with cat.MainDevice(Segment([AxisBlock(shared_data, [BOTH, CSP])])) as main:
        [sub] = main.scan(esi=False)
        with pytest.raises(ConfigurationError, match="modules= needs the ESI file"):
            cat.ProcessData(sub, modules=[BOTH])


@pytest.mark.parametrize("requested", [[BOTH, CSP], None])
def test_modules_that_appear_with_the_list(
    shared_data: Path, requested: list[str | int | None] | None
) -> None:
    model = LateBlock(shared_data, [BOTH, CSP])
    with opened(shared_data, model) as (_, sub):
        arm = cat.Drives([sub], modules=requested, counts_per_turn=2**20, velocity_limit=9.0)
        with cat.Loop(arm, period=2e-3) as loop:
            start = arm.actual.position.copy()
            for _cycle, count in zip(loop, range(100), strict=False):
                arm.target.position[:] = start + np.multiply(count, [0.001, -0.002])
            assert arm.enabled.all()
            assert abs(arm.actual.position - start).min() > 0.05
