"""Channels of oversampling terminals: several samples of one object in each cycle.

Terminals map the samples in one of two ways. A PDO has one entry per sample, with consecutive
subindices (Beckhoff's EL5031-0011, ELM3x0x). Or the PDO of one sample is assigned several times,
with consecutive indices (EL1262, EL3702, EL4732; `OSFac` in ETG.2000).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from catenary.drive.device_channels import NamedChannel

SAMPLES_MAX = 254  # PDOs of an assignment, or entries of a PDO
TIME_INDEX = 0x1D09  # objects named after the registers of distributed clocks
TIME_SUBINDICES = (0x98, 0x90)  # next SYNC1 (0x0998), next SYNC0 (0x0990)


class Oversampled(NamedTuple):
    """Channels of a request with oversampling."""

    channels: tuple[NamedChannel, ...]  # the samples of all groups, then the other channels
    names: tuple[str, ...]  # of the groups
    samples: int


def checked_samples(samples: object) -> int:
    """Return the option `oversampling` after a check.

    Raises:
        ValueError: It is not a whole number in the valid range.
    """
    if not isinstance(samples, int) or isinstance(samples, bool) or not 1 < samples <= SAMPLES_MAX:
        raise ValueError(
            f"oversampling={samples!r} must be a whole number of samples per cycle from 2 to "
            f"{SAMPLES_MAX}"
        )
    return samples


def group_samples(
    channels: Sequence[NamedChannel], samples: int, scale: Mapping[str, float]
) -> Oversampled:
    """Return the channels with the samples first, grouped by object.

    Args:
        channels: channels in the order of the process data.
        samples: number of samples of each group.
        scale: factor of each group by name; a group without one has raw numbers.

    Raises:
        ValueError: No object has this number of samples, the groups have different types, or a
            name is unknown.
    """
    runs = _runs(channels)
    groups = [run for run in runs if len(run) == samples]
    if not groups:
        found = sorted({len(run) for run in runs if len(run) > 1})
        shown = f"objects with {' and '.join(map(str, found))}" if found else "none with several"
        raise ValueError(
            f"oversampling={samples}: no object has {samples} samples in the process data of "
            f"device {channels[0].device} ({shown}); choose the OpMode, dc=DistributedClock("
            "op_mode=...), or the PDOs, pdos=, of this number"
        )
    names = _names(groups)
    for name in scale:
        if name not in names:
            raise ValueError(f"scale: unknown object {name!r}; it has {', '.join(names)}")
    scaled = [
        [_scaled(each, scale.get(name)) for each in group]
        for name, group in zip(names, groups, strict=True)
    ]
    if len({each.channel.bank for group in scaled for each in group}) > 1:
        raise ValueError(
            f"oversampling={samples}: {', '.join(names)} have different types and cannot be one "
            "array; give scale= for all of them"
        )
    first = [each for group in scaled for each in group]
    grouped = {id(each) for group in groups for each in group}
    others = [each for each in channels if id(each) not in grouped]
    return Oversampled((*first, *others), names, samples)


def time_channel(channels: Sequence[NamedChannel]) -> NamedChannel | None:
    """Return the channel with the time at which the next samples begin; None without one."""
    for subindex in TIME_SUBINDICES:
        for each in channels:
            if (each.channel.index, each.channel.subindex) == (TIME_INDEX, subindex):
                return each
    return None


def _scaled(each: NamedChannel, scale: float | None) -> NamedChannel:
    return each if scale is None else each._replace(channel=replace(each.channel, scale=scale))


def _runs(channels: Sequence[NamedChannel]) -> list[list[NamedChannel]]:
    """Return consecutive channels that are samples of one object."""
    runs: list[list[NamedChannel]] = []
    for each in channels:
        if runs and _continues(runs[-1][-1], each):
            runs[-1].append(each)
        else:
            runs.append([each])
    return runs


def _continues(one: NamedChannel, two: NamedChannel) -> bool:
    a, b = one.channel, two.channel
    if (one.device, a.index, a.type) != (two.device, b.index, b.type):
        return False
    pdos = two.which.pdo - one.which.pdo, b.subindex - a.subindex
    return pdos in ((1, 0), (0, 1))


def _names(groups: Sequence[Sequence[NamedChannel]]) -> tuple[str, ...]:
    """Return a unique name of each group: that of its first channel without its number."""
    names = [group[0].name.rstrip("0123456789 []") or group[0].name for group in groups]
    if len(set(names)) == len(names):
        return tuple(names)
    return tuple(f"{name} {names[: k + 1].count(name)}" for k, name in enumerate(names))
