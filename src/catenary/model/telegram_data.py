"""Process data of a SERCOS device: its telegrams as PDOs of a description."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.model.device import Assignment, DeviceDescription, Direction, Entry, Pdo
from catenary.model.sercos_axis import AT_LIST, MDT_LIST, SercosAxis
from catenary.wire.sercos import Display

OUTPUT_MANAGER, INPUT_MANAGER = 2, 3
_TYPES = {  # ETG.1000.6 table 64
    Display.SIGNED: {1: 0x02, 2: 0x03, 4: 0x04, 8: 0x15},
    Display.FLOAT: {4: 0x08, 8: 0x11},
}
_UNSIGNED = {1: 0x05, 2: 0x06, 4: 0x07, 8: 0x1B}


def with_process_data(device: DeviceDescription, axes: Sequence[SercosAxis]) -> DeviceDescription:
    """Return the description with the process data of drives.

    Args:
        device: The description.
        axes: The drives, in the order of their numbers.
    """
    outputs = tuple(_pdo(axis, Direction.OUTPUT) for axis in axes)
    inputs = tuple(_pdo(axis, Direction.INPUT) for axis in axes)
    return replace(
        device,
        sercos_axes=tuple(axes),
        outputs=(Assignment(OUTPUT_MANAGER, outputs, fixed=True),) if axes else (),
        inputs=(Assignment(INPUT_MANAGER, inputs, fixed=True),) if axes else (),
        output_pdos=outputs,
        input_pdos=inputs,
        mapping_source="SoE",
    )


def _pdo(axis: SercosAxis, direction: Direction) -> Pdo:
    """Return a telegram as a PDO. The index of an entry is its IDN, the subindex is the drive."""
    is_output = direction is Direction.OUTPUT
    suffix = f" of drive {axis.drive}" if axis.drive else ""
    entries = tuple(
        Entry(
            each.number,
            axis.drive,
            each.bit_length,
            each.idn + suffix,
            _TYPES.get(each.attribute.display, _UNSIGNED).get(each.attribute.size, 0),
            each.unit,
        )
        for each in (axis.outputs if is_output else axis.inputs)
    )
    index = (MDT_LIST if is_output else AT_LIST) | axis.drive << 12
    manager = OUTPUT_MANAGER if is_output else INPUT_MANAGER
    name = ("MDT" if is_output else "AT") + suffix
    return Pdo(index, entries, manager, fixed=True, mandatory=True, name=name)
