"""Files of the page, in memory, with entity tags."""

from __future__ import annotations

import gzip
import hashlib
import mimetypes
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).with_name("static")
COMPRESSED = ("text/", "application/javascript", "application/json", "image/svg")
BINARY = "application/octet-stream"
TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".txt": "text/plain"}


@dataclass(frozen=True, slots=True)
class StaticFile:
    """Content of a file of the page."""

    content: bytes
    compressed: bytes | None  # gzip
    type: str
    tag: str  # entity tag, from the content


def read_static_files(folder: Path = FOLDER) -> dict[str, StaticFile]:
    """Return the files of a folder by their names, without subfolders."""
    return {path.name: _read(path) for path in sorted(folder.iterdir()) if path.is_file()}


def _read(path: Path) -> StaticFile:
    content = path.read_bytes()
    kind = (
        TYPES.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    )
    is_text = kind.startswith(COMPRESSED)
    compressed = gzip.compress(content, mtime=0) if is_text else None
    tag = f'"{hashlib.sha256(content).hexdigest()[:32]}"'
    return StaticFile(content, compressed, f"{kind}; charset=utf-8" if is_text else kind, tag)
