"""Tuning over HTTP: capture one axis while it moves, and return its figures.

    POST /api/tune/capture   {axis, seconds}: {bode, identified, problems, rows, lost}
    GET  /api/tune/report    the figures of all captured axes as one HTML page; ?axis=NAME: of one

A capture only reads, and ends when its client disconnects. Start the motion with a jog, in the
program, or with a law.
"""

from __future__ import annotations

import asyncio
import html
import time
from collections.abc import Awaitable, Callable
from dataclasses import asdict, dataclass, field

import msgspec
import numpy as np
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from catenary.dashboard.app import Page, json_response, protected, read_body, refusal
from catenary.dashboard.security import Role
from catenary.dashboard.tuning import Bode, Capture, Identified, bode, identify
from catenary.share import Reader

SECONDS_MAX = 60.0
READ_INTERVAL = 0.2  # [s]
FIELDS = ("position", "commanded_position", "velocity", "torque")
COLUMNS = (
    *("axis", "inertia", "viscous friction", "Coulomb friction", "offset", "R²"),
    *("bandwidth [Hz]", "gain margin [dB]", "phase margin [°]"),
)


class CaptureRequest(msgspec.Struct):
    """Body of POST /api/tune/capture."""

    axis: int
    seconds: float = 5.0


@dataclass(slots=True)
class Figures:
    """Figures of one axis; None if the motion does not determine them."""

    axis: str
    rows: int
    lost: int
    bode: Bode | None = None
    identified: Identified | None = None
    problems: list[str] = field(default_factory=list)


class Tune:
    """Routes of the tuning, and the figures of the captured axes.

    Args:
        page: parts of the page.
    """

    def __init__(self, page: Page) -> None:
        self._busy = asyncio.Lock()
        self._figures: dict[str, Figures] = {}
        self.routes: list[BaseRoute] = [
            Route("/api/tune/capture", protected(page, self._capture), methods=["POST"]),
            Route("/api/tune/report", protected(page, self._report)),
        ]

    async def _capture(self, page: Page, request: Request, role: Role) -> Response:
        body = await read_body(request, CaptureRequest)
        if isinstance(body, Response):
            return body
        reader = page.hub.source.reader
        if reader is None:
            return refusal(404, page.hub.source.reason)
        if not 0 <= body.axis < len(reader.layout.axes) or not 0 < body.seconds <= SECONDS_MAX:
            return refusal(400, f"axis or seconds is out of range; at most {SECONDS_MAX:g} s")
        if self._busy.locked():
            return refusal(429, "another capture is running", hint="wait for its end")
        async with self._busy:
            try:
                captured, lost = await capture(
                    reader, body.axis, body.seconds, request.is_disconnected
                )
            except RuntimeError:  # the hub has closed the reader
                return refusal(409, page.hub.source.reason)
            if await request.is_disconnected():
                return Response(status_code=400)
            figures = await asyncio.to_thread(
                make_figures, reader.layout.axes[body.axis], captured, lost
            )
        self._figures[figures.axis] = figures
        return json_response(to_json(figures))

    async def _report(self, page: Page, request: Request, role: Role) -> Response:
        wanted = request.query_params.get("axis")
        figures = [each for each in self._figures.values() if wanted in (None, each.axis)]
        return Response(make_page(figures), media_type="text/html")


async def capture(
    reader: Reader, axis: int, seconds: float, is_ended: Callable[[], Awaitable[bool]]
) -> tuple[Capture, int]:
    """Return the values of an axis in the next `seconds` [s], and the number of lost cycles.

    Args:
        reader: reader of the share.
        axis: number of the axis.
        seconds: duration [s].
        is_ended: returns True to end the capture before.
    """
    end, number, lost = time.monotonic() + seconds, reader.number, 0
    parts = [np.empty((len(FIELDS), 0))]
    while (left := end - time.monotonic()) > 0 and reader.alive and not await is_ended():
        await asyncio.sleep(min(READ_INTERVAL, left))
        rows, missing = reader.rows(number)
        if len(rows):
            number, lost = int(rows["number"][-1]), lost + missing
            parts.append(np.array([rows[name][:, axis] for name in FIELDS], np.float64))
    values = np.concatenate(parts, axis=1)
    return Capture(reader.layout.period, *values), lost


def make_figures(axis: str, captured: Capture, lost: int) -> Figures:
    """Return the figures of a capture, with the reasons for missing ones.

    Args:
        axis: name of the axis.
        captured: its values.
        lost: number of lost cycles.
    """
    figures = Figures(axis, len(captured.position), lost)
    if lost:
        figures.problems.append(f"{lost} cycles were lost; capture again")
        return figures
    try:
        figures.identified = identify(captured)
    except ValueError as error:
        figures.problems.append(f"identification: {error}")
    try:
        figures.bode = bode(captured)
    except ValueError as error:
        figures.problems.append(f"frequency response: {error}")
    return figures


def to_json(figures: Figures) -> dict[str, object]:
    """Return figures as values that JSON can represent."""
    content = asdict(figures)
    if figures.bode is not None:
        content["bode"] = {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in asdict(figures.bode).items()
        }
    return content


def make_page(figures: list[Figures]) -> str:
    """Return the report of all captured axes. Names are escaped."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in COLUMNS)
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells(each)) + "</tr>"
        for each in figures
    )
    problems = "".join(
        f"<li>{html.escape(f'{each.axis}: {problem}')}</li>"
        for each in figures
        for problem in each.problems
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Tuning</title>'
        f"<h1>Tuning</h1><table border><tr>{head}</tr>{rows}</table><ul>{problems}</ul></html>"
    )


def cells(figures: Figures) -> list[str]:
    """Return the cells of an axis in the report, in the order of COLUMNS."""
    found, response = figures.identified, figures.bode
    names = ("inertia", "viscous", "coulomb", "offset", "determination")
    wanted = ("bandwidth", "gain_margin_db", "phase_margin_deg")
    numbers = [None if found is None else getattr(found, name) for name in names]
    numbers += [None if response is None else getattr(response, name) for name in wanted]
    return [figures.axis, *("-" if number is None else f"{number:.4g}" for number in numbers)]
