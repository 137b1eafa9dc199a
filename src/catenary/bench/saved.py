"""`catenary bench report`: print a saved result with its verdict."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec

from catenary.bench import latency
from catenary.bench.report import loop_text
from catenary.bench.setting import Setting
from catenary.bench.statistics import Run


def as_text(file: Path) -> str:
    """Return the report of a file that `catenary bench loop --json` or `latency --json` wrote.

    Raises:
        ValueError: The file is not a result of these commands.
    """
    try:
        figures = json.loads(file.read_text())
        if "latency_us" in figures:
            return latency.as_text(figures)
        return _of_loop(figures)
    except (KeyError, TypeError, ValueError, msgspec.ValidationError) as error:
        raise ValueError(
            f"{file} is not a result of `catenary bench loop` or `catenary bench latency`: {error}"
        ) from None


def _of_loop(figures: dict[str, Any]) -> str:
    runs = msgspec.convert(figures["runs"], type=list[Run])
    setting = msgspec.convert(figures, type=Setting)
    return loop_text(figures["machine"], setting, runs, figures["ratios"])
