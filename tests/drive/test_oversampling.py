"""Inputs(oversampling=...) and Outputs(oversampling=...): samples as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import catenary as cat
from catenary import types
from catenary.drive.channel import Channel
from catenary.drive.device_channels import NamedChannel
from catenary.drive.oversampling import group_samples
from catenary.plan.numbers import Which
from catenary.virtual import AnalogInputs, Coupler, OversamplingTerminal, Segment


@contextmanager
def scanned(*devices: Any) -> Iterator[Any]:
    with cat.MainDevice(Segment([Coupler(), *devices])) as main:
        yield main.scan()


def sample(name: str, pdo: int, index: int, subindex: int, kind: Any = types.INT) -> NamedChannel:
    return NamedChannel(name, 1, Channel(index, subindex, kind), Which(pdo, kind.bit_length))


def repeated(pdo: int, index: int, count: int) -> list[NamedChannel]:
    """Return the samples of an EL3702: one PDO per sample, with equal entries."""
    return [sample(f"Value {n}", pdo + n, index, 1) for n in range(count)]


def test_repeated_pdos_are_one_group_per_object() -> None:
    cycle_count = [sample("Ch1 CycleCount", 0x1B00, 0x6800, 1), sample("c2", 0x1B01, 0x6800, 2)]
    channels = [
        *(cycle_count[0], *repeated(0x1A00, 0x6000, 4)),
        *(cycle_count[1], *repeated(0x1A80, 0x6010, 4)),
    ]
    found = group_samples(channels, 4, {})
    assert [each.which.pdo for each in found.channels] == [
        *range(0x1A00, 0x1A04),
        *range(0x1A80, 0x1A84),
        *(0x1B00, 0x1B01),
    ]
    assert found.names == ("Value 1", "Value 2")


def test_a_pdo_with_one_entry_per_sample() -> None:
    channels = [sample(f"Samples [{n}]", 0x1A00, 0x6001, n + 1) for n in range(3)]
    assert group_samples(channels, 3, {}).names == ("Samples",)


def test_a_wrong_number_names_those_that_exist() -> None:
    with pytest.raises(ValueError, match=r"no object has 5 samples .*\(objects with 4\)"):
        group_samples(repeated(0x1A00, 0x6000, 4), 5, {})
    with pytest.raises(ValueError, match=r"none with several"):
        group_samples(repeated(0x1A00, 0x6000, 1), 5, {})


def test_objects_of_different_types_need_a_scale() -> None:
    reals = [sample(f"Real {n}", 0x1A80 + n, 0x6010, 1, types.REAL) for n in range(2)]
    channels = [*repeated(0x1A00, 0x6000, 2), *reals]
    with pytest.raises(ValueError, match="have different types"):
        group_samples(channels, 2, {})
    assert group_samples(channels, 2, {"Value": 0.5}).names == ("Value", "Real")


def test_the_array_is_a_view_with_scaled_values() -> None:
    terminal = OversamplingTerminal(channels=2, samples=5)
    terminal.apply_wave(0, lambda _: 1000)
    terminal.apply_wave(1, lambda _: -2000)
    with scanned(terminal) as subs:
        dc = cat.DistributedClock(op_mode="DcSync5")
        inputs = cat.Inputs(subs[1], dc=dc, oversampling=5)
        assert inputs.sample_names == ("Channel 1 Sample", "Channel 2 Sample")
        scale = dict.fromkeys(inputs.sample_names, 1e-3)
        inputs = cat.Inputs(subs[1], dc=dc, oversampling=5, scale=scale)
        with cat.Loop(inputs, period=1e-3) as loop:
            loop.run_for(0.1)
            assert inputs.samples.tolist() == [[1.0] * 5, [-2.0] * 5]
            assert np.shares_memory(inputs.samples, inputs.reals)
            assert inputs["NextSync1Time StartTimeNextLatch"] > 0


def test_times_need_distributed_clocks() -> None:
    with scanned(OversamplingTerminal(samples=5)) as subs:
        inputs = cat.Inputs(subs[1], oversampling=5)
        with cat.Loop(inputs, period=1e-3) as loop:
            cycle = next(loop)
            with pytest.raises(RuntimeError, match="need oversampling=, dc="):
                inputs.sample_times(cycle)


def test_a_request_without_samples() -> None:
    with scanned(OversamplingTerminal(samples=5), AnalogInputs()) as subs:
        inputs = cat.Inputs(subs[2])
        assert inputs.sample_names == ()
        with pytest.raises(RuntimeError, match="made without oversampling="):
            _ = inputs.samples
        with pytest.raises(ValueError, match="no object has 5 samples"):
            cat.Inputs(subs[2], oversampling=5)
        with pytest.raises(ValueError, match="exactly one device"):
            cat.Inputs(subs[1], subs[2], oversampling=5)
        with pytest.raises(ValueError, match="from 2 to 254"):
            cat.Inputs(subs[1], oversampling=1)
        with pytest.raises(ValueError, match="unknown object 'x'"):
            cat.Inputs(subs[1], oversampling=5, scale={"x": 1.0})


def test_the_times_on_a_clock_of_32_bits() -> None:
    terminal = OversamplingTerminal(channels=1, samples=5, clock_bits=32)
    counter = iter(range(1 << 30))
    terminal.apply_wave(0, lambda _: next(counter))
    with scanned(terminal) as subs:
        dc = cat.DistributedClock(op_mode="DcSync5")
        inputs = cat.Inputs(subs[1], dc=dc, oversampling=5)
        with cat.Loop(inputs, period=1e-3) as loop:
            loop.wait_locked()
            begun = next(loop).time
            times, values = [], []
            for cycle in loop:  # the times of the device wrap every 4.29 s
                times.append(inputs.sample_times(cycle))
                values.append(inputs.samples[0].copy())
                if cycle.time > begun + 4.4:
                    break
    assert np.diff(np.concatenate(times)) == pytest.approx(2e-4, abs=1e-6)
    assert (np.diff(np.concatenate(values).astype(np.int16)) == 1).all()
