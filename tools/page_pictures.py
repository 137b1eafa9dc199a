"""Pictures of the operator's page for the README and the documentation.

    python tools/page_pictures.py docs/images

They show examples/cobot/dashboard.py: an animation (page.webp), and four views (page_*.png). Needs
Chromium, and the extras dashboard, sim and test.
"""

from __future__ import annotations

import argparse
import io
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL import Image, ImageDraw

if TYPE_CHECKING:
    from playwright.sync_api import Page

ROOT = Path(__file__).resolve().parents[1]
WIDTH, HEIGHT = 1100, 720
SCALE = 0.76
FRAME = 105  # [ms] of the animation
SPEED = 1.5  # of the animation, at most
SETTLE = 4000  # [ms] until live values have filled the charts
VIEWS = {"overview": "Overview", "axes": "Axes", "devices": "Devices", "scope": "Scope"}
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
CURSOR = [(0, 0), (0, 17), (4, 13), (7, 20), (10, 19), (7, 12), (12, 12)]


class Film:
    """Frames of the page, with the pointer.

    Args:
        page: the page.
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        self.at = (WIDTH / 2, HEIGHT / 2)
        self.frames: list[Image.Image] = []

    def move(self, x: float, y: float) -> None:
        """Move the pointer."""
        self.at = (x, y)
        self.page.mouse.move(x, y)

    def shoot(self, count: int = 1) -> None:
        """Add frames."""
        for _ in range(count):
            begun = time.monotonic()
            image = Image.open(io.BytesIO(self.page.screenshot(type="jpeg", quality=92)))
            outline = [(self.at[0] + x, self.at[1] + y) for x, y in CURSOR]
            ImageDraw.Draw(image).polygon(outline, fill="black", outline="white")
            size = round(WIDTH * SCALE), round(HEIGHT * SCALE)
            self.frames.append(image.resize(size, Image.Resampling.LANCZOS))
            left = SPEED * FRAME / 1000 - (time.monotonic() - begun)
            self.page.wait_for_timeout(max(left, 0.0) * 1000)

    def click(self, target: Any, after: int) -> None:
        """Show the pointer at a target, click it, and add frames."""
        target.scroll_into_view_if_needed()
        box = target.bounding_box()
        self.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        self.shoot(3)
        self.page.mouse.down()
        self.page.mouse.up()
        self.shoot(after)

    def save(self, path: Path) -> None:
        """Write an animated WebP."""
        first, *rest = self.frames
        options: dict[str, Any] = {"save_all": True, "append_images": rest, "duration": FRAME}
        first.save(path, loop=0, quality=60, method=4, **options)


@contextmanager
def demo(name: str) -> Iterator[str]:
    """Run the cobot, and yield the link of an operator."""
    command = [sys.executable, str(ROOT / "examples/cobot/dashboard.py"), "--page"]
    options = ["--name", name, "--port", "0"]
    program = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True)
    try:
        lines = list(islice(program.stdout or (), 4))  # links, a note, and that the arm moves
        yield next(line.split()[1] for line in lines if line.startswith("operator: "))
    finally:
        program.send_signal(signal.SIGINT)
        program.wait(30.0)


def grab(film: Film) -> None:
    """Move the pointer over the 3D view until it holds the arm."""
    page, pushes = film.page, []
    page.on("request", lambda sent: pushes.append(sent) if is_push(sent.post_data) else None)
    box = page.locator(".scene-view canvas").bounding_box()
    assert box is not None
    for step in range(100):
        x = box["x"] + box["width"] * (0.40 + 0.02 * (step % 10))
        y = box["y"] + box["height"] * (0.25 + 0.03 * (step // 10))
        film.move(x, y)
        page.mouse.down()
        page.wait_for_timeout(150)
        if pushes:
            return
        page.mouse.up()
    raise SystemExit("the pointer has not found the arm")


def is_push(sent: str | None) -> bool:
    return sent is not None and "virtual_push" in sent


def push(film: Film) -> None:
    """Drag the arm with the pointer, and let it return."""
    grab(film)
    for _ in range(10):
        film.move(film.at[0] + 22, film.at[1] - 3)
        film.shoot()
    film.shoot(6)
    film.page.mouse.up()
    film.shoot(12)


def pull_and_plug(film: Film) -> None:
    """Pull a cable, show the event, and plug the cable."""
    page = film.page
    elbow = page.locator(".topology").get_by_role("link").nth(2)
    film.click(navigation(page, "Devices"), 3)
    film.click(elbow, 3)
    film.click(page.get_by_role("button", name="Pull cable at port 1"), 8)
    film.click(navigation(page, "Overview"), 12)
    film.click(navigation(page, "Devices"), 2)
    film.click(elbow, 2)
    film.click(page.get_by_role("button", name="Plug cable at port 1"), 6)
    film.click(navigation(page, "Axes"), 10)


def navigation(page: Page, view: str) -> Any:
    """Return the link of a view."""
    return page.get_by_role("navigation").get_by_role("link", name=view, exact=True)


def picture_views(page: Page, folder: Path) -> None:
    """Write one picture of each view."""
    for file, view in VIEWS.items():
        navigation(page, view).click()
        page.get_by_role("main", name=view).wait_for()
        page.wait_for_timeout(SETTLE)
        page.screenshot(path=folder / f"page_{file}.png")


def open_page(browser: Any, link: str) -> Page:
    """Open the page at the 3D view."""
    page: Page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light")
    page.set_default_timeout(60_000)
    page.goto(link)
    navigation(page, "Axes").click()
    page.locator(".scene-view canvas").wait_for()
    page.wait_for_timeout(SETTLE)
    return page


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the pictures of the operator's page.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--name", default="cobot", help="name of the share")
    arguments = parser.parse_args()
    folder: Path = arguments.folder
    from playwright.sync_api import sync_playwright

    with demo(arguments.name) as link, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = open_page(browser, link)
        film = Film(page)
        film.shoot(16)
        push(film)
        pull_and_plug(film)
        film.save(folder / "page.webp")
        picture_views(page, folder)
        browser.close()


if __name__ == "__main__":
    main()
