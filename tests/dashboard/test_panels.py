"""The 3D scene and recordings over HTTP and the WebSocket."""

from __future__ import annotations

import json
from pathlib import Path

import httpx
import pytest

from catenary.dashboard.options import Panels
from catenary.record.file import RecordingFile
from tests.dashboard.serving import running_loop, serving
from tests.record.beside import shared_loop
from tests.record.made import make_layout, make_rows
from tests.share.names import own_name
from tests.share.processes import comes_true

MODEL = """<mujoco><worldbody>
<body><joint name="a" axis="0 0 1"/><geom size=".1" pos="1 0 0"/></body></worldbody></mujoco>"""


def test_a_scene_and_its_poses(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    (tmp_path / "m.xml").write_text(MODEL)
    with own_name("scene") as name, shared_loop(name, axes=1) as shared:
        shared.run(20)
        with serving(name, panels=Panels(tmp_path / "m.xml")) as page:
            with httpx.Client(base_url=page.url) as stranger:
                assert stranger.get("/scene").status_code == 401
            data = page.client().get("/scene")
            assert data.status_code == 200
            assert data.content.startswith(b"CATSCENE")
            with page.socket() as socket:
                socket.next("hello")
                socket.send(op="poses", on=True)
                while not isinstance(received := socket.connection.recv(20), bytes):
                    pass
                assert received[0] == 3


def test_recordings_are_served(tmp_path: Path) -> None:
    layout = make_layout(1)
    file = RecordingFile(tmp_path / "arm.mcap", layout)
    file.write(make_rows(layout, 300))
    file.finish({})
    with own_name("files") as name, serving(name, panels=Panels(recordings=tmp_path)) as page:
        client = page.client()
        assert client.get("/scene").status_code == 204
        assert [f["name"] for f in client.get("/api/recordings").json()["files"]] == ["arm.mcap"]
        assert client.get("/api/recordings/arm.mcap").json()["duration"] == pytest.approx(0.299)
        assert client.get("/api/recordings/..%2Farm.mcap").status_code == 404
        url, body = "/api/recordings/arm.mcap/window", {"signals": ["number"], "start": 0, "end": 9}
        frame = client.post(url, content=json.dumps(body))
        assert (frame.status_code, frame.content[0]) == (200, 1)
        assert client.post(url, content=json.dumps({**body, "points": 0})).status_code == 400
        assert client.post(url, content="[]").status_code == 400


def test_an_axis_at_rest_is_captured_with_the_reasons_for_missing_figures() -> None:
    with own_name("tune") as name, running_loop(name), serving(name) as page:
        client = page.client("viewer")
        with page.socket() as socket:
            socket.next("hello")
        url = "/api/tune/capture"
        answer = client.post(url, content=json.dumps({"axis": 0, "seconds": 0.5}))
        assert answer.status_code == 200
        assert answer.json()["rows"] >= 200
        assert len(answer.json()["problems"]) in (1, 2)
        assert client.post(url, content=json.dumps({"axis": 9})).status_code == 400
        assert client.post(url, content='{"axis": 0, "seconds": 1e9}').status_code == 400
        report = client.get("/api/tune/report")
        assert report.headers["content-type"].startswith("text/html")
        axis = answer.json()["axis"]
        assert "<table" in report.text
        assert f"<td>{axis}</td>" in report.text
        other = client.get("/api/tune/report", params={"axis": "another"})
        assert f"<td>{axis}</td>" not in other.text


def test_a_capture_ends_with_its_client() -> None:
    with own_name("tune") as name, running_loop(name), serving(name) as page:
        client = page.client("viewer")
        with page.socket() as socket:
            socket.next("hello")
        url = "/api/tune/capture"
        with pytest.raises(httpx.ReadTimeout):
            client.post(url, content='{"axis": 0, "seconds": 60}', timeout=0.5)
        short = '{"axis": 0, "seconds": 0.2}'
        assert comes_true(lambda: client.post(url, content=short).status_code == 200)
        assert "<td>" in client.get("/api/tune/report").text
