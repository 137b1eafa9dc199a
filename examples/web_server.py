"""Positions and targets of drives over HTTP: `python web_server.py eth0`, until Ctrl-C.

    curl localhost:8080                                 positions [rad], state, error
    curl -d '{"position": [0.1, 0, 0]}' localhost:8080  targets, in one cycle
    curl -d '{"move_to": [0.5, 0, 0]}' localhost:8080   a move; the answer follows its end

Without arguments, it serves virtual drives and sends requests to itself. It listens on this machine
only, because every client can move the drives.
"""

import json
import sys
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.request import urlopen

import catenary as cat


class Axes(BaseHTTPRequestHandler):
    """Handler of one request, in its own thread."""

    def do_GET(self) -> None:
        states = [state and state.name for state in arm.state]
        error = str(loop.error) if loop.error else None
        position = arm.actual.position.tolist()
        self.answer(200, {"position": position, "state": states, "error": error})

    def do_POST(self) -> None:
        try:
            request = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            if "move_to" in request:
                loop.wait(arm.move_to(request["move_to"], velocity=0.5), timeout=30.0)
            else:
                with loop.update():  # all targets in the same cycle
                    arm.target.position[:] = request["position"]
        except (ValueError, TypeError, KeyError) as mistake:
            self.answer(400, {"error": repr(mistake)})
        except (cat.CatenaryError, RuntimeError) as error:
            self.answer(503, {"error": str(error)})
        else:
            self.do_GET()

    def answer(self, status: int, content: dict[str, object]) -> None:
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.end_headers()
        self.wfile.write(json.dumps(content).encode())

    def log_message(self, format: str, *arguments: object) -> None:
        """Do not log requests."""


def ask(url: str) -> None:
    """Move the drives forth and back, like a client."""
    for request in ({"position": [0.05, 0, 0]}, {"move_to": [0.3, 0, 0]}, {"move_to": [0, 0, 0]}):
        with urlopen(url, json.dumps(request).encode(), timeout=60) as answer:
            print(request, "→", answer.read().decode())


target, port = (sys.argv[1], 8080) if len(sys.argv) > 1 else ("virtual", 0)
with cat.MainDevice(target) as main, ThreadingHTTPServer(("127.0.0.1", port), Axes) as server:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
    with cat.Loop(arm, period=1e-3) as loop:
        loop.run_in_background()
        if port:
            server.serve_forever()
        Thread(target=server.serve_forever, daemon=True).start()
        ask(f"http://127.0.0.1:{server.server_port}")
        server.shutdown()
