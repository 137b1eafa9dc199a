"""AL status codes from the kernel's log.

libethercat does not report them, and the master clears them in the device when it acknowledges the
error. `ec_fsm_change_state_code` in IgH's master/fsm_change.c writes them to the log.
"""

from __future__ import annotations

import os
import re

LOG = "/dev/kmsg"  # one record for each read; needs root, or kernel.dmesg_restrict=0
RECORD_SIZE = 8192
MARK = b"EtherCAT ERROR"
LINE = r"EtherCAT ERROR {}-{}: (?:AL status message|Unknown AL status code) 0x([0-9A-Fa-f]{{4}})"


class KernelLog:
    """Reader of the kernel's log, from the time at which it was opened."""

    def __init__(self, path: str = LOG) -> None:
        self._text = ""
        self._file: int | None = None
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            os.lseek(self._file, 0, os.SEEK_END)
        except OSError:  # not permitted, or absent: `status_code` returns 0
            self.close()

    @property
    def readable(self) -> bool:
        """True if this process may read the log."""
        return self._file is not None

    def status_code(self, master: int, position: int) -> int:
        """Return the last AL status code of a device since the log was opened; 0 if none."""
        self._read()
        found = re.findall(LINE.format(master, position), self._text)
        return int(found[-1], 16) if found else 0

    def close(self) -> None:
        """Close the log."""
        file, self._file = self._file, None
        if file is not None:
            os.close(file)

    def _read(self) -> None:
        while self._file is not None:
            try:
                record = os.read(self._file, RECORD_SIZE)
            except BrokenPipeError:
                continue  # records were overwritten: the next read continues after them
            except BlockingIOError:
                return
            if not record:
                return
            if MARK in record:
                self._text += record.decode(errors="replace")
