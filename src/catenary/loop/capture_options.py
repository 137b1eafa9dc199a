"""Options of the captures of a loop: where, how long and how many."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

from catenary.errors import ConfigurationError
from catenary.loop.options import check_count

MINIMUM_MEMORY, MAXIMUM_MEMORY = 1 << 20, 1 << 30  # [bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureOptions:
    """Captures of the frames around an error, as pcapng files.

    Args:
        folder: Folder of the files. It is made if it does not exist.
        before: Time before the error [s]. The memory may hold less.
        after: Time after an axis was stopped [s]. After the error that ends the loop, the capture
            lasts until the devices have left OP.
        memory: Memory for the frames of each network [bytes]. Three drives at 1 kHz need about
            0.4 MB per second.
        files: Maximum number of files while the loop is open.

    Raises:
        ValueError: An option is impossible.
    """

    folder: str | os.PathLike[str]
    before: float = 10.0
    after: float = 1.0
    memory: int = 32 << 20
    files: int = 20

    def __post_init__(self) -> None:
        for name, value in (("before", self.before), ("after", self.after)):
            if not 0 <= value < math.inf:
                raise ValueError(f"{name}={value} s: must be 0 or a positive time")
        check_count("memory", self.memory, MINIMUM_MEMORY)
        if self.memory > MAXIMUM_MEMORY:
            raise ValueError(f"memory={self.memory}: must be at most {MAXIMUM_MEMORY} bytes")
        check_count("files", self.files, 1)

    def make_folder(self) -> Path:
        """Make the folder, and return its path.

        Raises:
            ConfigurationError: The folder cannot be made or written.
        """
        folder = Path(self.folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigurationError(
                f"capture: the folder {folder} cannot be made: {error.strerror}",
                hint="give a folder that this user may write",
            ) from error
        if not os.access(folder, os.W_OK | os.X_OK):
            raise ConfigurationError(
                f"capture: the folder {folder} cannot be written: no permission",
                hint=f"ls -ld {folder}",
            )
        return folder


def capture_options(
    given: CaptureOptions | str | os.PathLike[str] | None,
) -> CaptureOptions | None:
    """Return the options for the argument `capture` of a loop; None without captures.

    Raises:
        TypeError: The argument is neither a folder nor CaptureOptions.
    """
    if given is None or isinstance(given, CaptureOptions):
        return given
    if not isinstance(given, str | os.PathLike):
        raise TypeError(f"capture={given!r}: must be a folder or a cat.CaptureOptions(...)")
    return CaptureOptions(folder=given)
