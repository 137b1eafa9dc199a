"""Outputs that a drive was sent, decoded from a recording of the frames on the wire."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from catenary.plan.cycle import AxisPlan, CyclePlan, FramePlan, Number
from catenary.wire.capture import decode_capture
from catenary.wire.pcapng import Direction

FIRST_INDEX = 17  # offset of the first datagram's index in a frame
CYCLIC = range(0x80)  # indices of cyclic frames


class SentOutputs(NamedTuple):
    """Raw outputs of one axis in one frame."""

    controlword: int
    mode: int
    position: int
    velocity: int
    torque: int


def sent_to_axis(recording: Path, plan: CyclePlan, axis: int = 0) -> list[SentOutputs]:
    """Return what every cyclic frame of a recording sent to one axis.

    Args:
        recording: File of `vertical_cell(record=...)`, after the cell was left.
        plan: `loop.plan.cycle`, with one cyclic frame.
        axis: Number of the axis in the plan.
    """
    return [_outputs(image, plan.axes[axis]) for image in _images(recording, plan)]


def _images(recording: Path, plan: CyclePlan) -> Iterator[bytes]:
    [frame] = plan.frames
    for packet in decode_capture(recording.read_bytes()).packets:
        cyclic = packet.data[FIRST_INDEX] in CYCLIC and len(packet.data) == len(frame.template)
        if packet.direction is Direction.OUTBOUND and cyclic:
            yield _image(packet.data, frame, plan.output_size)


def _image(data: bytes, frame: FramePlan, size: int) -> bytes:
    image = bytearray(size)
    for datagram in frame.datagrams:
        for copy in datagram.outputs:
            part = data[copy.frame_offset : copy.frame_offset + copy.size]
            image[copy.image_offset : copy.image_offset + copy.size] = part
    return bytes(image)


def _outputs(image: bytes, axis: AxisPlan) -> SentOutputs:
    return SentOutputs(
        _raw(image, axis.controlword, signed=False),
        _raw(image, axis.mode_target),
        _raw(image, axis.target_position),
        _raw(image, axis.target_velocity),
        _raw(image, axis.target_torque),
    )


def _raw(image: bytes, number: Number | None, *, signed: bool = True) -> int:
    """Return the raw value of a number on whole bytes; 0 if it is not mapped."""
    if number is None:
        return 0
    first, size = number.bit_offset // 8, number.bit_length // 8
    return int.from_bytes(image[first : first + size], "little", signed=signed)
