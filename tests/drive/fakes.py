"""Fake layouts and SubDevices, so that tests of the drive layer need no bus."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from catenary.errors import SdoAbort
from catenary.model.device import Direction
from catenary.plan.cycle import Number, NumberKind
from catenary.plan.numbers import ANY, Which
from catenary.plan.request import DeviceRequest, RequestTables, Views


@dataclass
class FakeLayout:
    """Layout that places the objects of each device one after the other."""

    outputs: dict[int, dict[tuple[int, int], int]] = field(default_factory=dict)
    inputs: dict[int, dict[tuple[int, int], int]] = field(default_factory=dict)

    @classmethod
    def of(cls, requests: dict[int, DeviceRequest]) -> FakeLayout:
        def sizes(references: tuple) -> dict[tuple[int, int], int]:
            return {(r.index, r.subindex): r.bit_length for r in references}

        return cls(
            {device: sizes(request.outputs) for device, request in requests.items()},
            {device: sizes(request.inputs) for device, request in requests.items()},
        )

    def output(self, device: int, index: int, subindex: int, which: Which = ANY) -> Number | None:
        return place(self.outputs, device, index, subindex)

    def input(self, device: int, index: int, subindex: int, which: Which = ANY) -> Number | None:
        return place(self.inputs, device, index, subindex)

    def sync_unit(self, device: int) -> int:
        return device

    def byte_range(self, device: int, direction: Direction) -> range:
        sizes = (self.outputs if direction is Direction.OUTPUT else self.inputs).get(device, {})
        return range((sum(sizes.values()) + 7) // 8)

    def pdo_bits(self, device: int, direction: Direction, index: int) -> range | None:
        return None


def place(
    objects: dict[int, dict[tuple[int, int], int]], device: int, index: int, subindex: int
) -> Number | None:
    offset = 0
    for at in sorted(objects):
        for key, bits in objects[at].items():
            if (at, *key) == (device, index, subindex):
                return Number(offset, bits, NumberKind.UNSIGNED)
            offset += bits
    return None


@dataclass
class FakeSdo:
    """An object dictionary of 32-bit values; a missing object causes an SDO abort."""

    values: dict[tuple[int, int], int]
    position: int = 0

    def read(self, index: int, subindex: int, *, type: object = None) -> int:
        if (index, subindex) not in self.values:
            raise SdoAbort(
                "no object", position=self.position, index=index, subindex=subindex, code=0x06020000
            )
        return self.values[index, subindex]


SIZES = {0x6085: 4, 0x607C: 4, 0x607D: 4, 0x607F: 4, 0x6080: 4}  # [bytes] of objects; others: 2


@dataclass(eq=False)
class FakeMain:
    """A MainDevice with one device."""

    sdo: FakeSdo

    def read_objects(
        self, wanted: dict[int, list[tuple[int, int]]]
    ) -> dict[int, dict[tuple[int, int], bytes]]:
        return {position: self._found(places) for position, places in wanted.items()}

    def _found(self, places: list[tuple[int, int]]) -> dict[tuple[int, int], bytes]:
        there = {place: self.sdo.values[place] for place in places if place in self.sdo.values}
        return {
            (index, subindex): value.to_bytes(size_of(index), "little", signed=value < 0)
            for (index, subindex), value in there.items()
        }


def size_of(index: int) -> int:
    return SIZES.get(0x6000 | index & 0x7FF, 2)


def fake_sub(
    position: int, values: dict[tuple[int, int], int] | None = None, slots: tuple[int, ...] = (0,)
) -> SimpleNamespace:
    """A SubDevice for the drive layer: 0.64 N·m rated, interpolation time settable, a quick stop
    that brakes."""
    if values is None:
        values = {(0x6076, 0): 640, (0x605A, 0): 2, (0x60C2, 1): 2, (0x60C2, 2): -3}
    sdo = FakeSdo(values, position)
    return SimpleNamespace(
        position=position,
        name="Servo",
        sdo=sdo,
        slots=slots,
        is_drive=True,
        description=SimpleNamespace(sercos_axes=()),
        main=FakeMain(sdo),
    )


def views_of(tables: RequestTables) -> Views:
    """Zeroed arrays of the right sizes."""
    n = len(tables.axes)

    def count(columns: tuple, bank: int) -> int:
        return sum(column.bank == bank for column in columns)

    reals = [np.zeros(n) for _ in range(6)]
    return Views(
        *reals[:3],
        statusword=np.zeros(n, np.uint16),
        mode_actual=np.zeros(n, np.int8),
        axis_state=np.zeros(n, np.uint8),
        axis_flags=np.zeros(n, np.uint8),
        stop_reason=np.zeros(n, np.uint8),
        jogged=np.zeros(n, np.uint8),
        stop_cycle=np.zeros(n, np.uint64),
        target_position=reals[3],
        target_velocity=reals[4],
        target_torque=reals[5],
        mode_target=np.zeros(n, np.int8),
        requested_state=np.zeros(n, np.uint8),
        request=np.zeros(n, np.uint32),
        controlword_bits=np.zeros(n, np.uint16),
        input_reals=np.zeros(count(tables.input_columns, 0)),
        input_integers=np.zeros(count(tables.input_columns, 1), np.int64),
        input_bits=np.zeros(count(tables.input_columns, 2), np.uint8),
        input_bytes=np.zeros(sum(area.size for area in tables.input_areas), np.uint8),
        output_bytes=np.zeros(sum(area.size for area in tables.output_areas), np.uint8),
        output_reals=np.zeros(count(tables.output_columns, 0)),
        output_integers=np.zeros(count(tables.output_columns, 1), np.int64),
        output_bits=np.zeros(count(tables.output_columns, 2), np.uint8),
        unit_valid=np.ones(8, np.uint8),
        is_open=lambda: True,
    )
