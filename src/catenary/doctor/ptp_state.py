"""State of ptp4l, as its management client pmc(8) prints it; read-only."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

SOCKET = "/var/run/ptp4l"  # uds_address, ptp4l(8)
TIMEOUT = 5.0  # [s]
REQUESTS = ("GET TIME_STATUS_NP", "GET TIME_PROPERTIES_DATA_SET", "GET PORT_DATA_SET")


@dataclass(frozen=True, slots=True)
class PtpState:
    """State of ptp4l.

    ports: state of each port, such as SLAVE. offset: time of this clock minus that of the
    grandmaster [s]. grandmaster: True if another machine is the grandmaster. utc_offset: TAI minus
    UTC [s]; None if the grandmaster does not know it.
    """

    ports: tuple[str, ...]
    offset: float = 0.0
    grandmaster: bool = False
    utc_offset: int | None = None


def read_ptp_state(socket: str = SOCKET) -> PtpState | None:
    """Return the state of ptp4l; None if pmc is missing or gets no answer.

    Args:
        socket: management socket of ptp4l.
    """
    pmc = shutil.which("pmc", path=f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin")
    if pmc is None or not Path(socket).exists():
        return None
    with tempfile.TemporaryDirectory(prefix="catenary-") as folder:
        command = [pmc, "-u", "-b", "0", "-s", socket, "-i", f"{folder}/pmc", *REQUESTS]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
        except (OSError, subprocess.TimeoutExpired):
            return None
    return parse_ptp_state(done.stdout)


def parse_ptp_state(text: str) -> PtpState | None:
    """Return the state from the output of pmc; None if it contains no port."""
    ports = tuple(re.findall(r"^\s*portState\s+(\S+)", text, re.MULTILINE))
    if not ports:
        return None
    offset = _value(text, "currentUtcOffset")
    valid = _value(text, "currentUtcOffsetValid") == "1"
    return PtpState(
        ports,
        int(_value(text, "master_offset") or "0") * 1e-9,
        _value(text, "gmPresent") == "true",
        int(offset) if valid and offset is not None else None,
    )


def _value(text: str, name: str) -> str | None:
    found = re.search(rf"^\s*{name}\s+(\S+)", text, re.MULTILINE)
    return found[1] if found else None
