"""The Python interpreter of this program, and the permissions that a loop needs."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

CAPABILITIES = "cap_net_raw,cap_sys_nice,cap_ipc_lock=ep"
WARNING = (
    "; every user who can run this file gets raw sockets: restrict it by group and `chmod 750`"
)


def is_own(executable: str, prefix: str, base_prefix: str) -> bool:
    """Return True if the file that `setcap` would change belongs to a single environment.

    `python -m venv` creates a symbolic link to the base interpreter, unless `--copies` is given.

    Args:
        executable: Path of the interpreter, as in `sys.executable`.
        prefix: Folder of the environment, as in `sys.prefix`.
        base_prefix: Folder of the base installation, as in `sys.base_prefix`.
    """
    inside = Path(executable).resolve().is_relative_to(Path(prefix).resolve())
    return inside and (prefix != base_prefix or (Path(prefix) / "conda-meta").is_dir())


def permission_advice() -> str:
    """Return the commands that grant raw sockets, real-time scheduling and locked memory."""
    real = Path(sys.executable).resolve()
    if is_own(sys.executable, sys.prefix, sys.base_prefix):
        return f"sudo setcap {CAPABILITIES} {shlex.quote(str(real))}{WARNING}"
    return (
        f"run `python3 -m venv --copies .venv`, because {real} also runs other programs; install "
        f"catenary there; then run sudo setcap {CAPABILITIES} .venv/bin/python{WARNING}"
    )
