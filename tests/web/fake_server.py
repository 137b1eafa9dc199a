"""Server of the page for browser tests: plausible answers, and a record of all messages."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from playwright.sync_api import BrowserContext, Page, Route, WebSocketRoute

STATIC = Path(__file__).parents[2] / "src/catenary/dashboard/static"
ORIGIN = "http://catenary.test"
TYPES = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
}
CSP = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; "
    "frame-ancestors 'none'; require-trusted-types-for 'script'"
)
Message = dict[str, Any]


class Refusal(Exception):
    """Error of a method: the name of its class and its message."""


class FakeServer:
    """Answers of the server for one page, without a network."""

    def __init__(self, page: Page | BrowserContext, *, axes: int = 6, devices: int = 9) -> None:
        self.received: list[Message] = []
        self.calls: list[Message] = []
        self.sockets: list[WebSocketRoute] = []
        self.accepts = True
        self.confirms = True  # quick stops
        self.role = "operator"
        self.reason_no_jog: str | None = None
        self.axes = [f"joint_{number}" for number in range(1, axes + 1)]
        self.enabled = True
        self.jogged = False  # the first axis is in a jog: it does not follow the application
        self.state = "running"
        self.run = "run-1"
        self.number = 480_000
        self.modes: dict[str, str] = {}  # description by name
        self.presets: dict[str, str] = {}
        self.mode: str | None = None
        self.scene_problem = ""  # why there is no scene; "": there is no model
        self.methods: dict[str, Callable[[Message], object]] = {
            "devices": lambda _: make_devices(devices, self.axes),
            "axes": lambda _: [make_axis(at, name) for at, name in enumerate(self.axes)],
            "hello": lambda _: {"virtual": True, "version": "1.0.0rc1"},
            "clocks": lambda _: make_clocks(devices),
            "objects": make_objects,
            "sdo_read": lambda _: {"data": "", "value": 8, "type": "SINT", "text": "8"},
            "emergencies": lambda _: [],
            "diagnosis": lambda _: {"problems": [PROBLEM], "text": ""},
        }
        page.route(f"{ORIGIN}/**", self._serve)
        page.route_web_socket("ws://catenary.test/ws", self._open)

    def of(self, op: str) -> list[Message]:
        """Return the messages of the page of one kind."""
        return [message for message in self.received if message["op"] == op]

    def send(self, message: Message) -> None:
        for socket in self.sockets:
            socket.send(json.dumps(message))

    def send_token(self, token: str) -> None:
        self.send({"op": "token", "token": token})

    def send_status(self) -> None:
        """Send the status of the next 50 ms."""
        self.number += 50
        self.send(make_status(self))

    def send_timing(self) -> None:
        self.send(make_timing(self.number))

    def drop(self) -> None:
        """Close all sockets, as a server does that ends."""
        sockets, self.sockets = self.sockets, []
        for socket in sockets:
            socket.close()

    def _open(self, socket: WebSocketRoute) -> None:
        if not self.accepts:
            socket.close()
            return
        self.sockets.append(socket)
        socket.on_message(self._receive)
        socket.send(json.dumps(make_hello(self)))
        socket.send(json.dumps(make_status(self)))

    def _receive(self, data: str | bytes) -> None:
        message = json.loads(data)
        self.received.append(message)
        if message["op"] == "ping":
            self.send({"op": "pong", "t": message["t"]})
        elif message["op"] == "stop" and self.confirms:
            self.send({"op": "stopped"})

    def _serve(self, route: Route) -> None:
        path = route.request.url.removeprefix(ORIGIN).partition("?")[0]
        if not self.accepts:
            route.abort()
        elif path == "/api/call":
            body = route.request.post_data_json
            self.calls.append(body)
            route.fulfill(json=self._answer(body["method"], body["params"]))
        elif path == "/api/session":
            route.fulfill(
                json={
                    "role": self.role,
                    "share": "arm",
                    "reason_no_jog": self.reason_no_jog,
                    "version": "1.0.0rc1",
                }
            )
        elif path == "/scene":
            self._serve_scene(route)
        elif path == "/login":
            route.fulfill(status=204 if "right" in (route.request.post_data or "") else 403)
        else:
            self._serve_file(route, path)

    def _serve_scene(self, route: Route) -> None:
        if not self.scene_problem:
            route.fulfill(status=204)
            return
        error = {"kind": "Refused", "message": self.scene_problem, "hint": ""}
        route.fulfill(status=404, json={"error": error})

    def _answer(self, method: str, params: Message) -> Message:
        if method not in self.methods:
            return {"result": None}
        try:
            return {"result": self.methods[method](params)}
        except Refusal as error:
            kind, message = error.args
            return {"error": {"kind": kind, "message": message, "hint": ""}}

    def _serve_file(self, route: Route, path: str) -> None:
        file = STATIC / (path.lstrip("/") or "index.html")
        headers = {
            "Content-Security-Policy": CSP,
            "Content-Type": TYPES.get(file.suffix, "text/plain"),
        }
        route.fulfill(body=file.read_bytes(), headers=headers)


PROBLEM = {
    "what": "12 receive errors in 60 s",
    "where": "cable from device 3 (servo_2) port 1 to device 4 (servo_3)",
    "advice": "Check the connectors of this cable, or replace it.",
}
SCALARS = (("number", ""), ("scheduled_ns", "ns"))
PER_AXIS = (
    *(("position", "rad"), ("velocity", "rad/s"), ("torque", "N·m"), ("statusword", "")),
    *(("target_position", "rad"), ("commanded_position", "rad"), ("following_error", "rad")),
)


def make_hello(server: FakeServer) -> Message:
    count = len(server.axes)
    scalars = [
        {"name": name, "unit": unit, "shape": [], "per_axis": False} for name, unit in SCALARS
    ]
    arrays = [
        {"name": name, "unit": unit, "shape": [count], "per_axis": True} for name, unit in PER_AXIS
    ]
    return {
        "op": "hello",
        "share": "arm",
        "layout": {
            "fields": [*scalars, *arrays],
            "axes": server.axes,
            "period": 0.001,
            "clock": "monotonic",
            "utc_offset_ns": round((time.time() - time.monotonic()) * 1e9),
        },
        "run": server.run,
        "role": server.role,
        "reason_no_jog": server.reason_no_jog,
        "program": "cobot.py (4711)",
        "remote": True,
        "modes": make_choices(server.modes),
        "presets": make_choices(server.presets),
    }


def make_status(server: FakeServer) -> Message:
    now = server.number * 0.001
    return {
        "op": "status",
        "time": now,
        "state": server.state,
        "silent": 0.0,
        "number": server.number,
        "lost_in_row": 0,
        "lateness": 4.2e-6,
        "clients": 1,
        "mode": server.mode,
        "axes": [make_axis_status(server, at, name, now) for at, name in enumerate(server.axes)],
    }


def make_choices(descriptions: dict[str, str]) -> list[Message]:
    return [{"name": name, "description": text} for name, text in descriptions.items()]


def make_axis_status(server: FakeServer, at: int, name: str, now: float) -> Message:
    phase = now * 0.7 + at
    fault = at == 4 and len(server.axes) > 4
    enabled = server.enabled and not fault
    state = "FAULT" if fault else "OPERATION_ENABLED" if enabled else "SWITCH_ON_DISABLED"
    return {
        "name": name,
        "state": state,
        "enabled": enabled and not (server.jogged and at == 0),
        "jogged": server.jogged and at == 0,
        "fault": "0x8611: following error" if fault else "",
        "stop_reason": "the drive left operation because of a fault" if fault else "",
        "position": 1.2 * math.sin(phase),
        "velocity": 0.84 * math.cos(phase),
        "torque": 12 * math.sin(phase + 0.4),
        "commanded_position": 1.2 * math.sin(phase + 0.05),
    }


def make_axis(at: int, name: str) -> Message:
    return {
        "name": name,
        "network": 0,
        "device": at + 1,
        "unit": "rad",
        "mode": 8,
        "position_min": None if at == 5 else -2.9,
        "position_max": None if at == 5 else 2.9,
        "velocity_limit": 3.14,
        "torque_limit": None if at == 5 else 40.0,
        "acceleration": 12.0,
        "deceleration": 12.0,
    }


def make_devices(count: int, axes: list[str]) -> list[Message]:
    """Return a coupler with a branch, and servos after it; the last device closes a ring."""
    return [make_device(position, count, axes) for position in range(count)]


def make_device(position: int, count: int, axes: list[str]) -> Message:
    own = axes[position - 1 : position] if position else []
    parent, port = (position - 1, 1) if position else (None, None)
    if position == 3:
        parent, port = 1, 2
    last = position == count - 1
    links = {0: True, 1: position != 2, 2: position == 1, 3: False}
    return {
        "position": position,
        "network": 0,
        "name": f"servo_{position}"
        if own
        else "EK1100"
        if position == 0
        else f"EL{1000 + position}",
        "group": "Drives" if own else "Couplers",
        "vendor": 2,
        "product": 0x044C2C52,
        "revision": 0x00120000,
        "serial": 1000 + position,
        "alias": 0,
        "state": "SAFE-OP" if position == 5 else "" if position == 7 else "OP",
        "error": position == 5,
        "al_status_code": 0x001B if position == 5 else 0,
        "al_status_text": "SyncManager watchdog" if position == 5 else "",
        "parent": parent,
        "parent_port": port,
        "ports": [
            {
                "port": each,
                "link": link,
                "loop_closed": not link,
                "rx_errors": 12 if position == 4 and each == 0 else 0,
                "forwarded_errors": 0,
                "lost_links": 0,
            }
            for each, link in links.items()
            if each < (3 if position == 1 else 2) or last
        ],
        "delay_ns": 640 * position,
        "coe": True,
        "axes": own,
        "optional": False,
        "lost": position == 7,
    }


def make_clocks(count: int) -> Message:
    clocks = [
        {
            "position": position,
            "name": f"servo_{position}",
            "reference": position == 1,
            "difference": None if position == 1 else (-1) ** position * 14e-9,
        }
        for position in range(1, min(count, 5))
    ]
    return {"clocks": clocks, "locked": True, "text": ""}


def make_objects(params: Message) -> Message:
    first = 0x6000 if params["after"] is None else 0x6100
    entries = [make_object(first + at) for at in range(60)]
    if first == 0x6000:
        entries[:0] = [
            make_object(0x6060, "Modes of operation", "SINT", options={"8": "CSP", "9": "CSV"}),
            make_object(0x6065, "Following error window", "UDINT", unit="counts"),
        ]
    return {"entries": entries, "next": 0x60FF00 if first == 0x6000 else None, "notes": []}


def make_object(
    index: int,
    name: str = "Object",
    kind: str = "UINT",
    *,
    options: dict[str, str] | None = None,
    unit: str = "",
) -> Message:
    return {
        "index": index,
        "subindex": 0,
        "object_name": f"{name} {index:x}" if name == "Object" else name,
        "name": "",
        "type": kind,
        "bits": {"SINT": 8, "UINT": 16, "UDINT": 32}[kind],
        "access": "rw",
        "unit": unit,
        "options": options or {},
        "minimum": None,
        "maximum": None,
    }


def make_timing(number: int) -> Message:
    phases = {"lateness": 4e-6, "in_controller": 11e-6, "output_delay": 16e-6, "round_trip": 48e-6}
    return {
        "op": "timing",
        "figures": {
            phase: {"median": t, "p99": 1.9 * t, "p999": 3 * t, "max": 9 * t, "count": number}
            for phase, t in phases.items()
        },
        "counters": {"cycles": number, "lost": number // 20_000, "late": 3},
        "histograms": {phase: make_histogram(t, number) for phase, t in phases.items()},
    }


def make_histogram(median: float, number: int) -> list[list[float]]:
    edges = [median * 1.02**step for step in range(-60, 110)]
    heights = [math.exp(-((step / 14) ** 2)) for step in range(-60, 109)]
    total = sum(heights)
    counts = [round(number * each / total) for each in heights]
    return [
        [low, high, count]
        for low, high, count in zip(edges, edges[1:], counts, strict=False)
        if count
    ]
