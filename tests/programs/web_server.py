import json
from http.server import BaseHTTPRequestHandler, HTTPServer

import catenary as cat


class Axes(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(json.dumps(arm.actual.position.tolist()).encode())

    def do_POST(self) -> None:  # curl -d "[0.05, 0.0, 0.05]" localhost:8080
        goals = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        with loop.update():
            arm.target.position[:] = goals
        self.do_GET()


with cat.MainDevice("eth0") as main, HTTPServer(("127.0.0.1", 8080), Axes) as server:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
    with cat.Loop(arm, period=1e-3) as loop:
        loop.run_in_background()
        server.serve_forever()
