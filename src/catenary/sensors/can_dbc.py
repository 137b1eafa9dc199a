"""Messages of a CAN bus that a DBC file describes, through cantools."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from catenary.errors import ConfigurationError, DecodeError
from catenary.sensors.extra import require
from catenary.sensors.sensor import Channel, Value


class DbcMessage:
    """Message of a DBC file. Each signal becomes a scalar channel with its name and unit.

    Values are those of the file's scales and offsets, in the units of the file.
    """

    def __init__(self, message: Any) -> None:
        self._message = message
        self.identifier: int = message.frame_id
        self.extended: bool = message.is_extended_frame
        self.channels: Sequence[Channel] = [
            Channel(each.name, each.unit or "") for each in message.signals
        ]

    def decode(self, data: bytes) -> dict[str, Value]:
        """Return the values of the signals. Raises DecodeError if the length differs."""
        if len(data) != self._message.length:
            raise DecodeError(f"CAN message 0x{self.identifier:X} has {len(data)} bytes of data")
        found = self._message.decode(data, decode_choices=False)
        return {name: float(value) for name, value in found.items()}


def dbc_message(path: str | Path, name: str) -> DbcMessage:
    """Return a message of a DBC file, for `Can`.

    Args:
        path: path of the file.
        name: name of the message in the file.

    Raises:
        ConfigurationError: cantools is not installed, the file cannot be read, it has no such
            message, or the message is multiplexed.
    """
    database = require("cantools.database", "cantools", extra=False)
    try:
        message = database.load_file(str(path)).get_message_by_name(name)
    except KeyError:
        raise ConfigurationError(f"{path} has no message {name!r}") from None
    except (OSError, ValueError, database.UnsupportedDatabaseFormatError) as error:
        raise ConfigurationError(f"{path}: {error}") from error
    if message.is_multiplexed():
        raise ConfigurationError(f"message {name!r} of {path} is multiplexed: not supported")
    return DbcMessage(message)
