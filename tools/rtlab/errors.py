"""What the lab cannot do, in one line."""

from __future__ import annotations


class LabError(Exception):
    """One line for the terminal: what is missing or failed, and what to do next."""
