"""The cyclic loop: from wishes to `for cycle in loop`, and safely back."""

from catenary.core import Cycle
from catenary.loop.loop import Loop

__all__ = ["Cycle", "Loop"]
