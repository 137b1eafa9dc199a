"""The steps of a cycle over Catenary's own MainDevice, in an inline loop."""

from __future__ import annotations

from typing import NamedTuple

from catenary.loop import Loop
from catenary.model.device import Direction
from catenary.plan.request import Integers
from catenary.pyigh.request import ProcessDataRequest
from catenary.pyigh.slaves import Cell, SlaveBase
from catenary.wire.al import AlState


class ArrayCell(NamedTuple):
    """A mapped object in one of the loop's arrays."""

    array: Integers
    place: int

    def read(self) -> int:
        return int(self.array.item(self.place))

    def write(self, value: int) -> None:
        self.array[self.place] = value


class OwnSteps:
    """Inline loop, with one method per step of the program's own cycle.

    `receive` sends the outputs, waits for the cycle start and reads the inputs. A cycle of the loop
    therefore starts where a cycle of the program ends.
    """

    def __init__(self, request: ProcessDataRequest, slaves: list[SlaveBase], period: float) -> None:
        self._request = request
        self._loop = Loop(request, period=period, execution="inline", enable=False)
        self._loop.__enter__()
        self._cycle = next(self._loop)
        for slave in slaves:
            slave.bind(self._cells(slave))

    def receive(self) -> None:
        self._cycle = next(self._loop)

    def process(self) -> bool:
        return bool(self._cycle.ok)

    def queue(self) -> None:
        """Do nothing: the loop queues the outputs itself."""

    def write_time(self, time_ns: int) -> None:
        """Do nothing: the loop uses its own time."""

    def send(self) -> None:
        """Do nothing: the loop sends in `receive`."""

    def wait(self) -> None:
        """Do nothing: `receive` waits."""

    def status(self) -> tuple[int, int, bool]:
        last = self._loop.log[-1]
        return int(last["al_counter"]), int(last["al_status"]) & 0xF, bool(last["al_counter"])

    def state(self, position: int) -> tuple[bool, bool, int]:
        sub = self._request.main.subs[position]
        return sub.state is not None, sub.state is AlState.OP, int(sub.state or 0)

    def close(self) -> None:
        self._loop.__exit__(None, None, None)

    def _cells(self, slave: SlaveBase) -> dict[tuple[int, int], Cell]:
        views, made = self._request.views, self._request.tables_made
        assert views is not None
        sides = (
            (Direction.OUTPUT, made.output_columns, views.output_integers),
            (Direction.INPUT, made.input_columns, views.input_integers),
        )
        names = {
            f"{slave.position} 0x{each.index:04X}:{each.subindex:02X}": each
            for each in slave.objects
        }
        return {
            names[column.name].place: ArrayCell(array, place)
            for direction, columns, array in sides
            for place, column in enumerate(columns)
            if column.name in names and names[column.name].direction is direction
        }
