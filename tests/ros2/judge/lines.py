"""Loop of a process that answers commands: one JSON object per line, from stdin to stdout."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from typing import Any


def serve(spin: Callable[[], None], handlers: dict[str, Callable[..., Any]]) -> None:
    """Answer commands until stdin ends.

    Args:
        spin: handles messages for a short time; called between commands.
        handlers: functions by command. The answer is their return value.
    """
    os.set_blocking(sys.stdin.fileno(), False)
    rest = b""
    print(json.dumps({"answer": "ready"}), flush=True)
    while True:
        spin()
        try:
            data = os.read(sys.stdin.fileno(), 65536)
        except BlockingIOError:
            continue
        if not data:
            return
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            command = json.loads(line)
            answer = handlers[command.pop("do")](**command)
            print(json.dumps({"answer": answer}), flush=True)
