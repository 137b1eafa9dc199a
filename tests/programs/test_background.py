"""Programs in which the loop runs in the background, and one that changes a running law."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Thread
from urllib.request import urlopen

import pytest

from catenary.drive import Drives
from catenary.virtual import Segment, Servo

RunProgram = Callable[[str, Segment | str], Mapping[str, object]]


def drives(names: Mapping[str, object], name: str) -> Drives:
    found = names[name]
    assert isinstance(found, Drives)
    return found


def test_notebook(run_program: RunProgram, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    monkeypatch.setenv("MPLBACKEND", "agg")
    segment = Segment([Servo(name=name) for name in ("shoulder", "elbow", "wrist")])
    names = run_program("notebook", segment)
    assert drives(names, "arm").actual.position == pytest.approx([0.0] * 3, abs=2e-3)
    assert [segment[k].state & 0x0F for k in range(3)] == [1, 1, 1]
    labels = [line.get_label() for line in names["plot"].get_lines()]  # type: ignore[attr-defined]
    assert "shoulder.actual.position" in labels
    assert not any("elbow" in label for label in labels)


def test_notebook_velocity(run_program: RunProgram) -> None:
    segment = Segment([Servo()])
    names = run_program("notebook_velocity", segment)
    belt = drives(names, "belt")
    assert belt.actual.position[0] >= 0.5
    assert belt.target.velocity[0] == pytest.approx(0.0, abs=0.02)  # the core has ended it
    assert segment[0].state & 0x0F == 1


def test_asyncio_moves(run_program: RunProgram, capsys: pytest.CaptureFixture[str]) -> None:
    run_program("asyncio_moves", Segment([Servo(), Servo()]))
    lines = capsys.readouterr().out.splitlines()
    told = [re.sub("-0.00", "0.00", line) for line in lines]
    first = [line for line in told if "axis 0" in line]
    second = [line for line in told if "axis 1" in line]
    assert first == ["axis 0 is at 0.20 rad", "axis 0 is at -0.10 rad"]
    assert second == ["axis 1 is at 0.10 rad", "axis 1 is at 0.00 rad"]


class Served(HTTPServer):
    """A server on any free port, and a client of it that ends it."""

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        super().__init__((address[0], 0), handler)
        self.answers: list[list[float]] = []
        self._client = Thread(target=self._ask)

    def serve_forever(self, poll_interval: float = 0.01) -> None:
        self._client.start()
        super().serve_forever(poll_interval)
        self._client.join(60.0)

    def _ask(self) -> None:
        url = f"http://127.0.0.1:{self.server_port}"
        try:
            self._request(url, None)
            self._request(url, b"[0.05, 0.0, 0.05]")
            while self.answers[-1][0] < 0.049 and len(self.answers) < 10_000:
                self._request(url, None)
        finally:
            self.shutdown()

    def _request(self, url: str, body: bytes | None) -> None:
        with urlopen(url, body, timeout=10.0) as answer:
            self.answers.append(json.load(answer))


def test_web_server(run_program: RunProgram, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("http.server.HTTPServer", Served)
    names = run_program("web_server", Segment([Servo(), Servo(), Servo()]))
    server = names["server"]
    assert isinstance(server, Served)
    assert server.answers[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-3)
    assert server.answers[-1] == pytest.approx([0.05, 0.0, 0.05], abs=0.01)


def test_law_parameters(run_program: RunProgram) -> None:
    names = run_program("law_parameters", Segment([Servo(), Servo()]))
    assert names["reached"] == pytest.approx([0.2, 0.2], abs=2e-3)
    assert drives(names, "arm").actual.position == pytest.approx([-0.1, -0.1], abs=2e-3)
