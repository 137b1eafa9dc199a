"""The scene of a share, requested by several threads."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from catenary.dashboard import scene_feed
from catenary.dashboard.scene_feed import SceneFeed
from catenary.share import Reader

pytest.importorskip("mujoco")

ARM = Path(__file__).resolve().parents[2] / "examples" / "cobot" / "arm.xml"
JOINTS = ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")


def test_a_request_waits_while_another_thread_reads_the_model(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun, read = threading.Event(), scene_feed.Scene

    def slow(*arguments: Any, **options: Any) -> Any:
        begun.set()
        time.sleep(0.2)
        return read(*arguments, **options)

    monkeypatch.setattr(scene_feed, "Scene", slow)
    reader = cast(Reader, SimpleNamespace(layout=SimpleNamespace(run="1", axes=JOINTS)))
    feed = SceneFeed(ARM, {})
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(feed.scene, [reader])
        assert begun.wait(10.0)
        second = feed.scene([reader])
    assert second is not None
    assert second is first.result()
