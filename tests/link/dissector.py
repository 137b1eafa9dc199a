"""Dissection of a recording by tshark."""

from __future__ import annotations

import subprocess
from pathlib import Path


def dissect(tshark: str, path: Path, *fields: str) -> list[list[str]]:
    options = [part for field in fields for part in ("-e", field)]
    command = [tshark, "-r", str(path), "-T", "fields", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [line.split("\t") for line in done.stdout.splitlines()]
