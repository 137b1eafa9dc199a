"""Test double of libethercat, built once per session for each interface.

python -m tests.igh.double FOLDER       builds that of 1.6.1 and prints its path
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
OLD = ("1.5.2", "1.5.3", "1.6-alpha")
DEFINES = {
    "1.5.2": ("-DVERSION_MAGIC=0x105", "-DRELEASE=2", "-DRETURNS_VOID"),
    "1.5.3": ("-DVERSION_MAGIC=0x105", "-DRELEASE=3", "-DRETURNS_VOID"),
    "1.6-alpha": ("-DVERSION_MAGIC=0x106", "-DRELEASE=6", "-DRETURNS_VOID"),
    "1.6.1": ("-DVERSION_MAGIC=0x106", "-DRELEASE=60"),
}


def build(folder: Path, release: str, *more: str) -> Path:
    """Compile the double with the interface of a release."""
    path = folder / f"libethercat-{release}.so.1"
    compiler = shutil.which("cc") or "gcc"
    flags = ("-shared", "-fPIC", "-O2", "-Wall", "-Wextra", "-Werror")
    source = HERE / "double.c"
    subprocess.run(
        [compiler, *flags, *DEFINES[release], *more, "-o", path, source],
        check=True,
        capture_output=True,
        text=True,
    )
    return path


class Double:
    """Owns the controls of a double in a library that is loaded elsewhere, too."""

    def __init__(self, path: Path, slaves: int = 2) -> None:
        self.path = path
        self._library = ctypes.CDLL(str(path))
        self._library.double_calls.restype = ctypes.c_char_p
        self._library.double_reference.argtypes = [ctypes.c_uint64]
        self._library.double_value.restype = ctypes.c_long
        self._library.double_set.argtypes = [ctypes.c_int] * 3 + [ctypes.c_long]
        self._library.double_reset(slaves)

    def calls(self) -> list[str]:
        """Calls in order, with the relevant arguments."""
        return self._library.double_calls().decode().splitlines()

    def changes(self) -> list[str]:
        """Calls without those that only read devices and their states."""
        looks = ("master", "get_slave", "sdo_upload")
        return [call for call in self.calls() if not call.startswith(looks)]

    def __getattr__(self, name: str) -> ctypes._FuncPointer:
        return getattr(self._library, f"double_{name}")


if __name__ == "__main__":
    print(build(Path(sys.argv[1]), "1.6.1"))
