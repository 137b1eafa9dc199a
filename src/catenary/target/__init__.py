"""What a person calls a segment, "eth0" or "virtual:cell.toml" → a MainDevice on it."""

from catenary.target.main_device import MainDevice
from catenary.target.parse import parse

__all__ = ["MainDevice", "parse"]
