"""Cache of compiled laws in Numba's format, in a folder that only this user can write.

Numba unpickles the files of its cache. A user with write access can therefore run code as the user
of the law. Numba itself uses `__pycache__` next to the source. That folder may belong to another
user, be writable for a group, or be set by $NUMBA_CACHE_DIR. Catenary uses ~/.cache/catenary/laws
(below $XDG_CACHE_HOME if that is set), with mode 0700.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import re
import stat
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from catenary.loop.laws.dependencies import dependencies

OTHERS_WRITE = 0o022


def make_cache(function: Callable[..., Any]) -> Any | None:
    """Return Numba's cache of a function, with all of its dependencies in the key.

    Return None if the source is not a file. Warn and return None if no private folder is possible.
    """
    source = inspect.getfile(function)
    if not os.path.exists(source):  # the source was typed at a prompt, or is in a zip file
        return None
    try:
        folder = private_folder(cache_folder())
    except (OSError, RuntimeError) as error:  # RuntimeError: there is no home folder
        warnings.warn(
            f"compiled laws are not cached, so every start compiles them again: {error}. Only you "
            "and root may own or write the folders of the cache; set $XDG_CACHE_HOME to another "
            "folder",
            RuntimeWarning,
            stacklevel=2,
        )
        return None
    return _cache_class(folder)(function)


def cache_folder() -> Path:
    """Return the folder for compiled laws."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    base = Path(given) if os.path.isabs(given) else Path.home() / ".cache"
    return base / "catenary" / "laws"


def private_folder(folder: Path) -> Path:
    """Create a folder that only this user can write, with mode 0700, and return its real path.

    The folders above it, except those above the home folder, are also created or checked, as in
    OpenSSH's StrictModes (misc.c, safe_path). Each is checked before anything below it is created
    or changed, because root can have the HOME of another user (sudo).

    Raises:
        OSError: The folder cannot be created, or another user could replace it or a file in it.
    """
    folder = Path(os.path.abspath(folder))
    home = Path(os.path.expanduser("~"))
    # In a user namespace, root does not own these folders: user_namespaces(7), overflowuid.
    above_home = {*home.parents, *home.resolve().parents}
    for place in reversed(folder.parents):
        if place in above_home:
            continue
        _create(place)
        real = place.resolve(strict=True)
        for above in {real, *real.parents} - above_home:
            _refuse_writable(above)
    _create(folder)
    real = folder.resolve(strict=True)
    status = real.stat()
    if status.st_uid != os.geteuid():
        raise PermissionError(f"{folder} belongs to user {status.st_uid}")
    if folder.is_symlink():
        raise PermissionError(f"{folder} is a symbolic link")
    if stat.S_IMODE(status.st_mode) != 0o700:
        real.chmod(0o700)
    for path in real.glob("*.nb[ci]"):  # they may have been created before the folder was private
        found = path.lstat()
        if found.st_uid != os.geteuid() or found.st_mode & OTHERS_WRITE:
            raise PermissionError(f"other users can write {path}")
    return real


def _create(place: Path) -> None:
    """Create a folder if it is missing; refuse one of another user, except root."""
    if not os.path.lexists(place):
        place.mkdir(0o700, exist_ok=True)
    _refuse_foreign(place, place.lstat())  # of a symbolic link itself, not of its target


def _refuse_writable(place: Path) -> None:
    """Refuse a folder whose entries another user could replace."""
    status = place.stat()
    _refuse_foreign(place, status)
    if status.st_mode & OTHERS_WRITE and not status.st_mode & stat.S_ISVTX:
        raise PermissionError(f"other users can write in {place}")


def _refuse_foreign(place: Path, status: os.stat_result) -> None:
    if status.st_uid not in (0, os.geteuid()):
        raise PermissionError(f"{place} belongs to user {status.st_uid}")


def _cache_class(folder: Path) -> Any:
    """Return Numba's cache class with our folder and our key."""
    caching: Any = import_module("numba.core.caching")

    class Files(caching.CompileResultCacheImpl):  # type: ignore[misc]
        """Encoding of a compiled function, and name of its files."""

        def __init__(self, function: Callable[..., Any]) -> None:
            self._lineno = function.__code__.co_firstlineno
            self._locator = _Place(folder, inspect.getfile(function))
            name = re.sub(r"\W+", "", function.__qualname__)
            place = f"{self._locator._py_file}:{self._lineno}"
            version = f"py{sys.version_info[0]}{sys.version_info[1]}"
            self._filename_base = (
                f"{name}-{hashlib.sha256(place.encode()).hexdigest()[:16]}.{version}"
            )

    class LawCache(caching.FunctionCache):  # type: ignore[misc]
        """Cache of one law. If an entry is unreadable, the law is compiled again."""

        _impl_class = Files

        def _index_key(self, signature: Any, codegen: Any) -> tuple[Any, ...]:
            used = dependencies(self._py_func)
            return (*super()._index_key(signature, codegen), used)

        def load_overload(self, signature: Any, target_context: Any) -> Any:
            try:
                return super().load_overload(signature, target_context)
            except Exception:  # pickle raises any error for a file truncated by a full disk
                with suppress(OSError):
                    self.flush()
                return None

        def save_overload(self, signature: Any, data: Any) -> None:
            with suppress(OSError):  # disk full: the law runs uncached
                super().save_overload(signature, data)

    return LawCache


class _Place:
    """Numba's locator: the folder of a function's files, and their source."""

    def __init__(self, folder: Path, source: str) -> None:
        self._folder = folder
        self._py_file = os.path.abspath(source)  # appears in Numba's warnings

    def ensure_cache_path(self) -> None:
        """Do nothing: `private_folder` has created the folder."""

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> bytes:
        return hashlib.sha256(Path(self._py_file).read_bytes()).digest()
