"""Routes of the 3D view and of the recordings; catenary.dashboard.tune has those of the tuning.

GET  /scene                        the scene (catenary.dashboard.scene); 204 without a model
GET  /api/recordings               {files}
GET  /api/recordings/NAME          layout, duration and events
POST /api/recordings/NAME/window   a binary frame, or 202 {progress}
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from catenary.dashboard.app import Page, json_response, protected, read_body, refusal
from catenary.dashboard.companions import Companions
from catenary.dashboard.options import Panels
from catenary.dashboard.recordings import Folder, Progress, Window
from catenary.dashboard.scene_feed import SceneFeed
from catenary.dashboard.security import Role
from catenary.dashboard.tune import Tune
from catenary.errors import CatenaryError

BINARY = "application/octet-stream"


def make_scene(panels: Panels) -> SceneFeed | None:
    """Return the scene of a server; None without a model."""
    if panels.model is None:
        return None
    moves, shares = panels.base is not None, 1 + len(panels.also)
    return SceneFeed(panels.model, panels.joints, moves=moves, shares=shares)


def make_companions(panels: Panels, uid: int | None = None) -> Companions:
    """Return the further shares of a server.

    Args:
        panels: files and shares to show.
        uid: owner of the shares; None: this user or root.
    """
    return Companions(panels.also, panels.base, uid)


def panel_routes(panels: Panels, page: Page) -> list[BaseRoute]:
    """Return the routes.

    Args:
        panels: files to show.
        page: parts of the page.
    """
    routes: list[BaseRoute] = [Route("/scene", protected(page, scene)), *Tune(page).routes]
    if panels.recordings is None:
        return [*routes, Route("/api/recordings", protected(page, no_recordings))]
    return [*routes, *RecordingRoutes(page, Folder(panels.recordings)).all]


async def no_recordings(page: Page, request: Request, role: Role) -> Response:
    """Return the empty list of a server without a folder of recordings."""
    return json_response({"files": []})


async def scene(page: Page, request: Request, role: Role) -> Response:
    """Return the 3D scene; an empty response if the server has no model."""
    feed, readers = page.hub.scene, page.hub.readers
    if feed is None:
        return Response(status_code=204)  # not an error: browsers report those in their console
    if not readers:
        return refusal(404, page.hub.source.reason)
    found = await asyncio.to_thread(feed.scene, readers)
    if found is None:
        return refusal(404, feed.problem)
    return Response(found.data, headers={"Cache-Control": "no-store"}, media_type=BINARY)


class RecordingRoutes:
    """Routes of the recordings of a folder. One request at a time reads files.

    Args:
        page: parts of the page.
        folder: the recordings.
    """

    def __init__(self, page: Page, folder: Folder) -> None:
        self._folder = folder
        self._reading = asyncio.Lock()
        name = "/api/recordings/{name}"
        self.all: list[BaseRoute] = [
            Route("/api/recordings", protected(page, self._list)),
            Route(name, protected(page, self._describe)),
            Route(f"{name}/window", protected(page, self._window), methods=["POST"]),
        ]

    async def _list(self, page: Page, request: Request, role: Role) -> Response:
        return await self._read(lambda: json_response({"files": self._folder.files()}))

    async def _describe(self, page: Page, request: Request, role: Role) -> Response:
        name = request.path_params["name"]
        return await self._read(lambda: json_response(self._folder.open(name).describe()))

    async def _window(self, page: Page, request: Request, role: Role) -> Response:
        body = await read_body(request, Window)
        if isinstance(body, Response):
            return body
        name = request.path_params["name"]
        return await self._read(lambda: window_response(self._folder, name, body))

    async def _read(self, work: Callable[[], Response]) -> Response:
        async with self._reading:
            try:
                return await asyncio.to_thread(work)
            except CatenaryError as error:
                return refusal(404, error.message, hint=error.hint)
            except (ValueError, OSError) as error:
                return refusal(400, str(error))


def window_response(folder: Folder, name: str, window: Window) -> Response:
    """Return the response to the request for a window.

    Args:
        folder: the recordings.
        name: name of the file.
        window: the request.
    """
    found = folder.open(name).window(window)
    if isinstance(found, Progress):
        return json_response(found, 202)
    return Response(found.for_subscription(0), media_type=BINARY)
