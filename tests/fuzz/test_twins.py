"""Twins of damaged SIIs and absurd clones: an error of the package, or a device that is scanned."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given, settings
from hypothesis import strategies as st

import catenary as cat
from catenary.errors import CatenaryError
from catenary.line import ClonedDevice, Line, write_line
from catenary.virtual import Device, Segment, Servo
from catenary.wire import register
from tests.line.clones import devices, objects

IMAGE = Servo().sii_image()
CATEGORIES = 128  # byte of the first category


def scanned(segment: Segment) -> None:
    """Scan a segment, and run a loop if its process data can be planned."""
    with cat.MainDevice(segment) as main:
        try:
            subs = main.scan(strict=False)
            with cat.Loop(cat.ProcessData(subs[0]), period=2e-3) as loop:
                next(loop)
        except CatenaryError:
            return


@settings(max_examples=40)
@given(st.lists(st.tuples(st.integers(0, 700), st.integers(0, 255)), max_size=12))
def test_a_damaged_sii_is_refused_or_served(changes: list[tuple[int, int]]) -> None:
    image = bytearray(IMAGE)
    for place, value in changes:
        image[place] = value
    try:
        model = Device.from_sii(bytes(image))
    except CatenaryError:
        return
    scanned(Segment([model]))


@settings(max_examples=40)
@given(st.binary(max_size=300))
def test_random_categories_are_refused_or_served(categories: bytes) -> None:
    try:
        model = Device.from_sii(IMAGE[:CATEGORIES] + categories)
    except CatenaryError:
        return
    scanned(Segment([model]))


PDO_INDICES = st.sampled_from([0x1600, 0x1A00, 0x1C12, 0x1C13, 0x6040, 0x6041, 0x6064, 0x1018])


@settings(max_examples=40)
@given(st.data(), devices(0), st.binary(min_size=10, max_size=10))
def test_an_absurd_clone_is_refused_or_served(
    data: st.DataObject, device: ClonedDevice, information: bytes
) -> None:
    indices = sorted(data.draw(st.sets(PDO_INDICES, max_size=4)))
    found = [data.draw(objects(index)) for index in indices]
    registers = {**device.registers, register.INFORMATION.address: information}
    device = replace(
        device,
        sii=IMAGE,
        missing={},
        registers=registers,
        objects=tuple(found) or device.objects,
    )
    with TemporaryDirectory() as folder:
        try:
            write_line(Line((device,)), Path(folder) / "line")
            segment = Segment.from_clone(Path(folder) / "line")
        except CatenaryError:
            return
    scanned(segment)
