"""Outputs to which `catenary report` does not send 0 without consent."""

from __future__ import annotations

from dataclasses import replace

import pytest

import catenary as cat
from catenary.cli.report_segment import has_unknown_outputs
from catenary.model.device import Assignment, DeviceDescription, Entry, Pdo


def describe_servo() -> DeviceDescription:
    with cat.MainDevice(cat.Segment([cat.virtual.Servo()])) as line:
        return line.scan()[0].description


def assigned(index: int, bits: int) -> tuple[Assignment, ...]:
    """Return an assignment of one PDO with a controlword and another object."""
    entries = (Entry(0x6040, 0, 16), Entry(index, 1, bits))
    return (Assignment(2, (Pdo(0x1600, entries, 2),)),)


@pytest.mark.parametrize(
    ("index", "bits", "unknown"),
    [
        (0x60FE, 32, False),  # digital outputs of the axis
        (0x6841, 16, True),  # an axis that this drive does not have
        (0x7000, 16, True),  # a further module, such as an analog output
        (0x2005, 16, True),
        (0x2005, 1, False),
        (0, 16, False),  # a gap
    ],
)
def test_further_outputs_of_a_drive_are_unknown(index: int, bits: int, unknown: bool) -> None:
    device = replace(describe_servo(), outputs=assigned(index, bits))
    assert has_unknown_outputs(device) == unknown


def test_outputs_without_a_description_are_unknown() -> None:
    empty = (Assignment(2, (Pdo(0x1600, (Entry(0, 0, 8),), 2),)),)
    device = replace(describe_servo(), slots=(), outputs=empty, output_pdos=empty[0].pdos)
    assert has_unknown_outputs(device)
