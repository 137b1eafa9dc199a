"""Combination of the process-data requests for each device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from catenary.errors import ConfigurationError
from catenary.model.module import ConfiguredModule
from catenary.model.sercos_axis import SercosAxis
from catenary.plan.request import (
    DeviceRequest,
    DistributedClock,
    ObjectReference,
    ProcessDataRequest,
    WrittenPdo,
)
from catenary.plan.start_up_object import StartUp


def gather_requests(
    requests: Sequence[ProcessDataRequest], period_ns: int
) -> dict[int, DeviceRequest]:
    """Return the combined requests for each device, by position.

    Args:
        requests: Process-data requests.
        period_ns: Period of the cycle [ns].

    Raises:
        ConfigurationError: Two requests for a device contradict each other.
    """
    gathered: dict[int, DeviceRequest] = {}
    for request in requests:
        for position, pdos in request.pdos(period_ns).items():
            before = gathered.get(position, DeviceRequest(divider=0, required=False))
            gathered[position] = DeviceRequest(
                _merged(before.outputs, pdos.outputs),
                _merged(before.inputs, pdos.inputs),
                before.start_up + tuple(d for d in pdos.start_up if d not in before.start_up),
                _one_clock(position, before.clock, pdos.clock),
                math.gcd(before.divider, pdos.divider),
                before.required or pdos.required,
                _one_mapping(position, before.pdos, pdos.pdos),
                _one_start_up(position, before.objects, pdos.objects),
                _one_list(position, before.modules, pdos.modules),
                _one_telegram(position, before.telegrams, pdos.telegrams),
                before.idns + tuple(each for each in pdos.idns if each not in before.idns),
            )
    return {
        position: request if request.divider else replace(request, divider=1)
        for position, request in gathered.items()
    }


def _one_clock(
    position: int, first: DistributedClock | None, second: DistributedClock | None
) -> DistributedClock | None:
    if first is not None and second is not None and first != second:
        raise ConfigurationError(
            f"device {position}: two requests need different clocks: {first} and {second}",
            hint="give both the same dc=",
        )
    return first if second is None else second


def _one_mapping(
    position: int, first: tuple[WrittenPdo, ...], second: tuple[WrittenPdo, ...]
) -> tuple[WrittenPdo, ...]:
    """Return the PDOs that two requests specify. Raise ConfigurationError if they contradict."""
    directions = {pdo.direction for pdo in first} & {pdo.direction for pdo in second}
    for direction in directions:
        if [p for p in first if p.direction is direction] != [
            p for p in second if p.direction is direction
        ]:
            raise ConfigurationError(
                f"device {position}: two requests specify different PDOs for {direction.noun}",
                hint="give both the same pdos=, or only one of them",
            )
    return first + tuple(pdo for pdo in second if pdo not in first)


def _one_start_up(
    position: int, first: tuple[StartUp, ...], second: tuple[StartUp, ...]
) -> tuple[StartUp, ...]:
    """Return the start-up objects of two requests. Raise ConfigurationError if they contradict."""
    values = {(each.index, each.subindex): each for each in first}
    for each in second:
        other = values.get((each.index, each.subindex))
        if other is not None and other != each and each not in first:
            raise ConfigurationError(
                f"device {position}: two requests write different values to start-up object "
                f"{each.place}: {other.value!r} and {each.value!r}",
                hint="give both the same start_up=, or only one of them",
            )
    return first + tuple(each for each in second if each not in first)


def _one_list(
    position: int,
    first: tuple[ConfiguredModule, ...] | None,
    second: tuple[ConfiguredModule, ...] | None,
) -> tuple[ConfiguredModule, ...] | None:
    """Return the modules that two requests name. Raise ConfigurationError if they contradict."""
    if first is not None and second is not None and first != second:
        raise ConfigurationError(
            f"device {position}: two requests have different modules in its slots: "
            f"{', '.join(map(str, first))} and {', '.join(map(str, second))}",
            hint="give both the same modules=, or only one of them",
        )
    return first if second is None else second


def _one_telegram(
    position: int, first: tuple[SercosAxis, ...], second: tuple[SercosAxis, ...]
) -> tuple[SercosAxis, ...]:
    """Return the telegrams of two requests. Raise ConfigurationError if they contradict."""
    if first and second and first != second:
        raise ConfigurationError(
            f"device {position}: two requests need different telegrams",
            hint="give all drives of the device to one Drives(...)",
        )
    return first or second


def _merged(
    first: tuple[ObjectReference, ...], second: tuple[ObjectReference, ...]
) -> tuple[ObjectReference, ...]:
    return first + tuple(reference for reference in second if reference not in first)
