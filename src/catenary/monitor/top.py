"""`catenary top`: axes, bus and events of a share in a terminal, by textual.

Import this module only if textual is installed (`catenary.monitor.extra`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import BindingType
from textual.widgets import DataTable, Footer, RichLog, Static

from catenary.errors import CatenaryError
from catenary.monitor.snapshot import AxisSummary, Summary, plain
from catenary.monitor.source import Source
from catenary.share import SharedEvent

INTERVAL = 0.25  # [s] between two updates
STOP_WITHIN = 2.0  # [s] between the two strokes of a quick stop
COLUMNS = ("axis", "state", "mode", "position", "velocity", "torque", "remarks")
WIDTHS = (17, 15, 5, 10, 10, 10, 12)  # 79 columns
STATES = {  # shorter than in the standard
    "not ready to switch on": "not ready",
    "switch on disabled": "disabled",
    "ready to switch on": "ready",
    "operation enabled": "enabled",
    "quick stop active": "quick stop",
    "fault reaction active": "fault reaction",
}
STOPPED = "quick stop requested for all axes"
ASK = f"press s again within {STOP_WITHIN:g} s for a quick stop of all axes"


class Top(App[None]):
    """Terminal page of one share. Press q to quit, and s twice for a quick stop of all axes."""

    CSS = """
    #loop, #bus, #notice { height: 1; padding: 0 1; }
    #loop { text-style: bold; background: $primary-background; }
    #notice { color: $warning; }
    DataTable { height: 1fr; padding: 0 0 0 1; overflow-x: hidden; }
    RichLog { height: 7; border-top: solid $primary; padding: 0 1; overflow-x: hidden; }
    """
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        ("q", "quit", "Quit"),
        ("s", "stop", "Quick stop (press twice)"),
    ]

    def __init__(self, source: Source, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._source = source
        self._clock = clock
        self._asked = float("-inf")  # time of the first stroke of a quick stop
        self._shown: tuple[str, ...] | None = None  # axes in the table

    def compose(self) -> ComposeResult:
        yield Static(id="loop")
        yield Static(id="bus")
        yield Static(id="notice")
        yield DataTable(cursor_type="none", zebra_stripes=True, cell_padding=0)
        yield RichLog(max_lines=500, wrap=True, min_width=40)
        yield Footer()

    def on_mount(self) -> None:
        table = self.query_one(DataTable)
        for name, width in zip(COLUMNS, WIDTHS, strict=True):
            table.add_column(name, key=name, width=width)
        self.refresh_values()
        self.set_interval(INTERVAL, self.refresh_values)

    def refresh_values(self) -> None:
        """Show the newest cycle and the new events."""
        summary = self._source.take()
        self.query_one("#loop", Static).update(self._loop_text(summary))
        if summary is not None:
            self.query_one("#bus", Static).update(Text(bus_text(summary)))
            self._show_axes(summary.axes)
        for event in self._source.events():
            self.query_one(RichLog).write(event_text(event))
        if self._clock() - self._asked > STOP_WITHIN:
            self._notice("")

    def action_stop(self) -> None:
        """Request a quick stop at the second stroke within STOP_WITHIN."""
        now = self._clock()
        first = now - self._asked > STOP_WITHIN
        self._asked = now if first else self._asked
        if first:
            self._notice(ASK)
            return
        try:
            self._source.stop()
            self._notice(STOPPED)
        except CatenaryError as error:
            self._notice(f"no quick stop: {plain(error.message)}")

    def _loop_text(self, summary: Summary | None) -> Text:
        layout = self._source.reader.layout
        head = f"{layout.name}  {layout.writer}  {1 / layout.period:.6g} Hz"
        if self._source.reason:
            return Text(f"{head}  {self._source.reason}; waiting for it to return", style="red")
        number = self._source.reader.number if summary is None else summary.number
        stalled = "" if summary is not None else "  no new cycle"
        return Text(f"{head}  cycle {number}{stalled}", style="red" if stalled else "")

    def _show_axes(self, axes: tuple[AxisSummary, ...]) -> None:
        table = self.query_one(DataTable)
        names = tuple(axis.name for axis in axes)
        if names != self._shown:
            table.clear()
            for number, axis in enumerate(axes):
                table.add_row(*axis_cells(axis), key=str(number))
            self._shown = names
            return
        for number, axis in enumerate(axes):
            for column, cell in zip(COLUMNS, axis_cells(axis), strict=True):
                table.update_cell(str(number), column, cell)

    def _notice(self, text: str) -> None:
        self.query_one("#notice", Static).update(Text(text))


def bus_text(summary: Summary) -> str:
    """Return the line about the bus: cycles that were lost and the times since the last update."""
    bus = summary.bus
    return (
        f"lost {bus.lost}/{bus.cycles}  in a row {bus.lost_in_row}  skipped {bus.skipped}  "
        f"late {micro(bus.lateness)}  work {micro(bus.in_controller)}  "
        f"bus {micro(bus.round_trip)} us"
    )


def micro(seconds: float) -> str:
    """Return a duration in whole microseconds; "-" if it is NaN."""
    return f"{seconds * 1e6:.0f}" if seconds == seconds else "-"


def axis_cells(axis: AxisSummary) -> tuple[Text, ...]:
    """Return the cells of an axis, in the order of COLUMNS."""
    style = "red" if axis.fault or axis.remarks else "green" if axis.enabled else ""
    numbers = (axis.position, axis.velocity, axis.torque)
    state = STATES.get(axis.state, axis.state)
    cells = (axis.name[:16], state, axis.mode, *map("{:9.4f}".format, numbers), axis.remarks)
    return tuple(Text(cell, style=style) for cell in cells)


def event_text(event: SharedEvent) -> Text:
    """Return the line of an event."""
    return Text(plain(f"{event.time:9.3f} s  {event.message}"))
