"""Server of the operator's page with synthetic samples: the page without a loop.

It implements the part of the protocol in `web/src/protocol.ts` that the scope uses: session,
hello, and full-rate frames. The signals are sines with a step each second.
"""

from __future__ import annotations

import asyncio
import struct
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

CSP = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; "
    "frame-ancestors 'none'; require-trusted-types-for 'script'"
)
HEAD = struct.Struct("<BBHIIIdd")
PERIOD = 0.001  # [s]
FIELDS = {
    "position": "rad",
    "commanded_position": "rad",
    "velocity": "rad/s",
    "commanded_velocity": "rad/s",
    "torque": "N·m",
    "commanded_torque": "N·m",
}


def hello(axes: int) -> dict[str, Any]:
    """Return the first message of a connection."""
    fields = [
        {"name": name, "unit": unit, "shape": [axes], "per_axis": True}
        for name, unit in FIELDS.items()
    ]
    layout = {
        "fields": fields,
        "axes": [f"axis {number}" for number in range(axes)],
        "period": PERIOD,
        "clock": "monotonic",
        "utc_offset_ns": 0,
    }
    return {
        "op": "hello",
        "share": "synthetic",
        "layout": layout,
        "run": "1",
        "role": "viewer",
        "reason_no_jog": "this session is a viewer",
        "program": "benchmark",
        "remote": False,
        "modes": [],
        "presets": [],
    }


def samples(signals: int, first: int, rows: int) -> npt.NDArray[np.float64]:
    """Return the samples of all signals, shape (signals, rows)."""
    cycle = np.arange(first, first + rows)
    phase = np.arange(signals)[:, None]
    sine = np.sin(cycle * PERIOD * (1.0 + 0.1 * phase) * 6.0 + phase)
    noise = 0.03 * np.sin(cycle * 12.9898 + phase * 78.233) ** 3
    return sine + noise + (cycle // 500 % 2) * 0.5


def frame(subscription: int, signals: int, first: int, rows: int, lost: int = 0) -> bytes:
    """Encode one frame of every sample."""
    head = HEAD.pack(1, 1, subscription, rows, signals, lost, float(first), PERIOD)
    time = np.arange(first, first + rows) * PERIOD
    return head + time.tobytes() + samples(signals, first, rows).tobytes()


class Session:
    """One WebSocket client; it owns the table of its subscriptions."""

    def __init__(self, websocket: Any, axes: int, scene: Any = None) -> None:
        self.websocket = websocket
        self.axes = axes
        self.scene = scene
        self.poses = False
        self.subscriptions: dict[int, int] = {}

    async def run(self) -> None:
        """Send frames until the client closes the connection."""
        from starlette.websockets import WebSocketDisconnect

        await self.websocket.accept()
        await self.websocket.send_json(hello(self.axes))
        sender = asyncio.create_task(self.send())
        try:
            while True:
                self.receive(await self.websocket.receive_json())
        except WebSocketDisconnect:
            sender.cancel()

    def receive(self, message: Mapping[str, Any]) -> None:
        """Apply a message of the client."""
        if message["op"] == "subscribe":
            self.subscriptions[message["id"]] = len(message["signals"])
        elif message["op"] == "unsubscribe":
            self.subscriptions.pop(message["id"], None)
        elif message["op"] == "poses":
            self.poses = message["on"]

    async def send(self) -> None:
        """Send the samples since the last frame 60 times per second."""
        clock = asyncio.get_running_loop().time
        last = int(clock() / PERIOD)
        while True:
            await asyncio.sleep(1 / 60)
            now = int(clock() / PERIOD)
            for number, signals in list(self.subscriptions.items()):
                await self.websocket.send_bytes(frame(number, signals, last, now - last))
            if self.scene is not None and self.poses:
                await self.websocket.send_bytes(self.pose_message(now))
            last = now

    def pose_message(self, cycle: int) -> bytes:
        """Return the poses at a cycle; the targets are 0.2 s ahead."""
        actual, target = samples(self.axes, cycle, 1), samples(self.axes, cycle + 200, 1)
        poses: bytes = self.scene.poses(cycle * PERIOD, actual[:, 0], target[:, 0])
        return poses


def application(static: Path, axes: int, scene: Any = None) -> Any:
    """Return the ASGI application.

    Args:
        static: folder of the page.
        axes: number of axes.
        scene: `catenary.dashboard.scene.Scene` with as many axes; None: without 3D.
    """
    from starlette.applications import Starlette
    from starlette.responses import FileResponse, JSONResponse, Response
    from starlette.routing import Route, WebSocketRoute

    async def session(_request: Any) -> Any:
        return JSONResponse(
            {"role": "viewer", "share": "synthetic", "reason_no_jog": "viewer", "version": "0"}
        )

    async def file(request: Any) -> Any:
        name = Path(request.path_params["name"] or "index.html").name
        return FileResponse(static / name, headers={"Content-Security-Policy": CSP})

    async def shapes(_request: Any) -> Any:
        return Response(scene.data) if scene is not None else Response(status_code=404)

    async def socket(websocket: Any) -> None:
        await Session(websocket, axes, scene).run()

    return Starlette(
        routes=[
            Route("/api/session", session),
            Route("/scene", shapes),
            WebSocketRoute("/ws", socket),
            Route("/{name:path}", file),
        ]
    )


@contextmanager
def serving(static: Path, axes: int = 33, scene: Any = None) -> Iterator[str]:
    """Serve the page in a thread, and return its address. The arguments are of `application`."""
    import uvicorn

    config = uvicorn.Config(application(static, axes, scene), port=0, log_level="error")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started and thread.is_alive():
        threading.Event().wait(0.01)
    port = server.servers[0].sockets[0].getsockname()[1]
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join(10)
