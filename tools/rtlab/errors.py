"""Error of the lab."""

from __future__ import annotations


class LabError(Exception):
    """Failure of the lab. The message is one line: the cause and the next step."""
