"""Screenshots of all views of the operator's page, for reviews and for the documentation.

    python tools/screenshots.py out/screenshots

They show a virtual machine in light and dark, on a desktop (1280) and on a phone (390).
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from contextlib import ExitStack
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

VIEWS = ("Overview", "Axes", "Devices", "Scope", "Tune", "Recordings")
WIDTHS = (1280, 390)
SCHEMES = ("light", "dark")
SETTLE = 2500  # [ms] until live values have filled the charts


def main() -> None:
    parser = argparse.ArgumentParser(description="Make screenshots of the operator's page.")
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    from playwright.sync_api import sync_playwright

    from tests.browser.chromium import started
    from tests.browser.rig import local_rig

    command = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if command is None:
        raise SystemExit("Chromium is not installed (package chromium)")
    with ExitStack() as stack:
        playwright = stack.enter_context(sync_playwright())
        browser = stack.enter_context(started(playwright, command)).browser
        rig = local_rig(stack, browser, modes=True)
        for width, scheme in product(WIDTHS, SCHEMES):
            with rig.open(width=width, touch=width < 1000, scheme=scheme) as shown:
                shown.open()
                present = shown.page.get_by_role("navigation").get_by_role("link")
                names = [text.strip() for text in present.all_inner_texts()]
                for view in [each for each in VIEWS if each in names]:
                    shown.show(view)
                    shown.page.wait_for_timeout(SETTLE)
                    file = folder / f"{view.lower()}-{width}-{scheme}.png"
                    shown.page.screenshot(path=file)
                    print(file)


if __name__ == "__main__":
    main()
