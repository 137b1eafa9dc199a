"""Process with the servos on one end of a wire: `python -m tests.browser.cell INTERFACE NAMES`.

NAMES is a JSON list. The servos continue when the process of the loop is stopped or killed.
"""

from __future__ import annotations

import json
import sys

from catenary.virtual import serve
from tests.browser.servos import Monitor, answer_line, make_segment


def main(interface: str, names: str) -> None:
    segment = make_segment(json.loads(names))
    monitor = Monitor(segment)

    def ready() -> None:
        answer_line("ready")
        monitor.start()

    serve(segment, interface, max_age=None, with_parent=True, ready=ready)


if __name__ == "__main__":
    main(*sys.argv[1:])
