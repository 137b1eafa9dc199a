"""What a person calls a segment, "eth0" or "virtual:cell.toml" → a MainDevice on it."""

from catenary.target.main_device import MainDevice, open_main_device
from catenary.target.parse import parse

__all__ = ["MainDevice", "open_main_device", "parse"]
