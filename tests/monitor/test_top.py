"""The terminal page, driven through textual's pilot at 80 x 24."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator

import pytest

from catenary.monitor.snapshot import BusSummary, Summary
from catenary.monitor.source import Source
from catenary.plan.sink import Incident
from tests.record.beside import SharedLoop, shared_loop
from tests.share.names import own_name

pytest.importorskip("textual")

from textual.pilot import Pilot
from textual.widgets import DataTable, RichLog, Static

from catenary.monitor.top import ASK, Top, bus_text

Scenario = Callable[[Top, Pilot[None]], Coroutine[None, None, None]]


class StopCounter(Source):
    """Source that counts the requested quick stops."""

    stops = 0

    def stop(self) -> None:
        self.stops += 1


@pytest.fixture
def shared() -> Iterator[SharedLoop]:
    with own_name("page") as name, shared_loop(name) as shared:
        shared.run(20)
        yield shared


def run(shared: SharedLoop, scenario: Scenario, now: Callable[[], float]) -> Source:
    source = StopCounter(shared.share.name)
    app = Top(source, now)

    async def drive() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            await scenario(app, pilot)

    asyncio.run(drive())
    source.close()
    return source


def text(app: Top, name: str) -> str:
    return str(app.query_one(name, Static).render())


def test_the_page_shows_loop_axes_and_events(shared: SharedLoop) -> None:
    shared.share.report(Incident("DeviceLost", "device 2 [red] is lost\x1b", 1.5))

    async def scenario(app: Top, pilot: Pilot[None]) -> None:
        shared.run(50)
        app.refresh_values()
        await pilot.pause()
        assert shared.share.name in text(app, "#loop")
        assert "lost 0/" in text(app, "#bus")
        table = app.query_one(DataTable)
        rows = [[str(cell) for cell in table.get_row_at(n)] for n in range(table.row_count)]
        assert [row[0] for row in rows] == [name[:16] for name in shared.share.layout.axes]
        assert {row[1] for row in rows} == {"enabled"}
        assert "device 2 [red] is lost?" in app.query_one(RichLog).lines[0].text
        svg = app.export_screenshot()
        assert "enabled" in svg
        assert "\x1b" not in svg

    run(shared, scenario, lambda: 0.0)


def test_a_quick_stop_needs_two_strokes_within_two_seconds(shared: SharedLoop) -> None:
    now = [0.0]

    async def scenario(app: Top, pilot: Pilot[None]) -> None:
        await pilot.press("s")
        assert text(app, "#notice") == ASK
        now[0] = 3.0
        await pilot.press("s")
        assert text(app, "#notice") == ASK
        now[0] = 4.0
        await pilot.press("s")
        assert "requested" in text(app, "#notice")

    source = run(shared, scenario, lambda: now[0])
    assert isinstance(source, StopCounter)
    assert source.stops == 1


def test_q_quits(shared: SharedLoop) -> None:
    async def scenario(app: Top, pilot: Pilot[None]) -> None:
        assert app.is_running
        await pilot.press("q")
        await pilot.pause()
        assert not app.is_running

    run(shared, scenario, lambda: 0.0)


def test_an_ended_loop_is_named(shared: SharedLoop) -> None:
    async def scenario(app: Top, pilot: Pilot[None]) -> None:
        shared.loop.close()
        for _ in range(2):
            app.refresh_values()
        assert "the loop has ended; waiting for it to return" in text(app, "#loop")

    run(shared, scenario, lambda: 0.0)


def test_the_line_of_the_bus_fits_in_80_columns() -> None:
    bus = BusSummary(1000, 1000, 1000, 9999, 1e-3, 1e-3, 1e-3)
    assert len(bus_text(Summary(1, 0.0, bus, ()))) <= 78
