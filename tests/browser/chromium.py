"""Chromium in its own session, so that a test can stop and kill all of its processes."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Playwright

from tests.browser.processes import with_parent
from tests.share.processes import DEADLINE

OPTIONS = (
    "--headless=new",
    "--no-sandbox",  # Chromium refuses to run as root with its sandbox
    "--disable-gpu",
    "--use-angle=swiftshader",  # WebGL without a GPU
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--no-default-browser-check",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--remote-debugging-port=0",
)


class Chromium:
    """Owner of the processes of a browser."""

    def __init__(self, playwright: Playwright, path: str, profile: Path) -> None:
        self.process = subprocess.Popen(
            with_parent("--exec", path, *OPTIONS, f"--user-data-dir={profile}", "about:blank"),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self.browser: Browser = playwright.chromium.connect_over_cdp(self._address(profile))

    def _address(self, profile: Path) -> str:
        """Wait until the browser has written the port of its debugger."""
        file, until = profile / "DevToolsActivePort", time.monotonic() + DEADLINE
        while time.monotonic() < until:
            with contextlib.suppress(FileNotFoundError):
                lines = file.read_text().splitlines()
                if len(lines) == 2:
                    return f"ws://127.0.0.1:{lines[0]}{lines[1]}"
            if self.process.poll() is not None:
                raise AssertionError(f"Chromium ended with status {self.process.returncode}")
            time.sleep(0.02)
        raise TimeoutError(f"Chromium did not start within {DEADLINE:g} s")

    def signal(self, number: int) -> None:
        os.killpg(self.process.pid, number)

    def end(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.signal(signal.SIGKILL)
        self.process.wait(DEADLINE)


@contextlib.contextmanager
def started(playwright: Playwright, path: str) -> Iterator[Chromium]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        chromium = Chromium(playwright, path, Path(profile))
        try:
            yield chromium
        finally:
            chromium.end()
