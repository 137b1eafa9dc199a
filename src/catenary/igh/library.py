"""Library: libethercat, found and checked at run time."""

from __future__ import annotations

import ctypes
import ctypes.util
import os
from pathlib import Path

from catenary.errors import CatenaryError, LinkError
from catenary.igh import abi

VARIABLE = "CATENARY_LIBETHERCAT"  # environment variable with the path of the library
PLACES = (
    "libethercat.so.1",
    "/usr/local/lib/libethercat.so.1",
    "/opt/etherlab/lib/libethercat.so.1",
    "/usr/local/etherlab/lib/libethercat.so.1",
)
INSTALL = (
    "install IgH's EtherCAT master (docs/how_to/igh.md), or set the library's path: "
    f"{VARIABLE}=/opt/etherlab/lib/libethercat.so.1"
)


class Library:
    """Loaded libethercat. Each call is an attribute: `library.ecrt_master_send(master)`.

    `returns` is True from 1.6.0 on. Before 1.6.0, some calls return nothing instead of 0 or -errno.
    Their return values are then never read.
    """

    def __init__(self, path: str | os.PathLike[str] | None = None) -> None:
        """Load the library.

        Args:
            path: Path of the library; None for `CATENARY_LIBETHERCAT` or the usual places.

        Raises:
            LinkError: No library was found, or its version is not supported.
        """
        self._loaded, self.path = _load(path)
        self.returns = hasattr(self._loaded, abi.RETURNS_SINCE)
        self.addresses: dict[str, int] = {}
        missing = []
        for name, types in abi.CALLS.items():
            try:
                function = getattr(self._loaded, name)
            except AttributeError:
                if name not in abi.NOT_IN_ALL:
                    missing.append(name)
                continue
            result, *arguments = types.split()
            if result == "r":
                result = "s32" if self.returns else "v"
            function.restype = abi.TYPES[result]
            function.argtypes = [abi.TYPES[each] for each in arguments]
            self.addresses[name] = ctypes.cast(function, ctypes.c_void_p).value or 0
        self._check(missing)

    def __getattr__(self, name: str) -> ctypes._FuncPointer:
        """Return a call with its declared types."""
        if not name.startswith("ecrt_") or name not in self.addresses:
            raise AttributeError(name)
        function: ctypes._FuncPointer = getattr(self._loaded, name)
        return function

    def ask(self, name: str, *arguments: object, what: str, hint: str = "") -> int:
        """Make a call and check its result.

        Args:
            name: Name of the call.
            *arguments: Arguments of the call.
            what: Name of the action in an error message.
            hint: Hint of the error; a general one by default.

        Returns:
            The result, 0 or more; 0 for a call without a result.

        Raises:
            CatenaryError: The call returned -errno.
        """
        result = getattr(self, name)(*arguments)
        if result is None:
            return 0
        if result < 0:
            raise CatenaryError(
                f"{what}: {name} returned {result} ({os.strerror(-result)})",
                hint=hint or "see the kernel's log: dmesg | tail",
            )
        return int(result)

    def has(self, name: str) -> bool:
        """Return True if this release has the call."""
        return name in self.addresses

    @property
    def version(self) -> str:
        """Version from the version magic, such as "1.6"."""
        magic = int(self.ecrt_version_magic())
        return f"{magic >> 8}.{magic & 0xFF}"

    def _check(self, missing: list[str]) -> None:
        if "ecrt_version_magic" in missing:
            raise LinkError(f"{self.path} is not libethercat", hint=INSTALL)
        magic = int(self.ecrt_version_magic())
        if magic not in abi.MAGICS:
            known = " and ".join(f"{each >> 8}.{each & 0xFF}" for each in abi.MAGICS)
            raise LinkError(
                f"{self.path} is libethercat {magic >> 8}.{magic & 0xFF} (version magic "
                f"0x{magic:04X}), which is not supported; supported: {known}, from 1.5.2 on",
                hint="its structures may differ; install a supported release",
            )
        if missing:
            raise LinkError(
                f"{self.path}, libethercat {self.version}, lacks {', '.join(missing)}",
                hint="install release 1.5.2 or later",
            )


def _load(path: str | os.PathLike[str] | None) -> tuple[ctypes.CDLL, str]:
    given = os.fspath(path) if path is not None else os.environ.get(VARIABLE)
    found = ctypes.util.find_library("ethercat")
    tried = [given] if given else [*([found] if found else []), *PLACES]
    reasons = []
    for each in tried:
        try:
            return ctypes.CDLL(each, use_errno=True), each
        except OSError as error:
            reasons.append(str(error))
    if given:
        hint = "check the path" if not Path(given).exists() else INSTALL
        raise LinkError(f"libethercat cannot be loaded: {reasons[0]}", hint=hint)
    raise LinkError(f"no libethercat on this machine (tried {', '.join(tried)})", hint=INSTALL)
