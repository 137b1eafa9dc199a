"""MainDevice by the name of a segment, such as "eth0" or "virtual:cell.toml"."""

from catenary.target.clone_target import clone
from catenary.target.main_device import MainDevice, source_of
from catenary.target.parse import named_target, parse, segment_of
from catenary.target.toml_file import TomlFile, is_machine_file, read_toml, target_of

__all__ = [
    "MainDevice",
    "TomlFile",
    "clone",
    "is_machine_file",
    "named_target",
    "parse",
    "read_toml",
    "segment_of",
    "source_of",
    "target_of",
]
