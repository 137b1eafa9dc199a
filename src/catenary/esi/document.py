"""Bytes of an ESI file: reading within limits, encoding, and repairs before the XML parser.

Repairs keep the length of the bytes, so that offsets are those of the file on disk.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from stat import S_ISREG
from typing import NamedTuple

from catenary.errors import EsiError
from catenary.esi.encoding import Encoding, choose_encoding, without_faults
from catenary.esi.source import EsiWarning, Source

FORBIDDEN = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")  # XML 1.0 §2.2
BLANKS = bytes(byte if byte >= 32 or byte in b"\t\n\r" else 32 for byte in range(256))


class Limits(NamedTuple):
    """Limits of a file. Larger files are refused."""

    file_size: int = 128 << 20  # [bytes]; the largest real files have about 45 MB
    token_size: int = 8 << 20  # longest tag or comment [bytes]
    elements: int = 5_000_000  # in the file; 45 MB have about 1 500 000
    tree_elements: int = 500_000  # in one tree
    depth: int = 64
    children: int = 100_000  # of one element
    attributes: int = 100  # of one element
    attribute_length: int = 65_536  # [characters]
    text_length: int = 8 << 20  # of one element [characters]


LIMITS = Limits()


class Document(NamedTuple):
    """Bytes of a file, or of one of its elements. `data` has the length of the original bytes."""

    file: str  # name in messages
    data: bytes
    encoding: Encoding
    mark: int = 0  # bytes before the first character
    line: int = 1  # line of the first byte
    warnings: tuple[EsiWarning, ...] = ()


def open_document(path: str | Path, limits: Limits = LIMITS) -> Document:
    """Read a file, after a check of its size.

    Args:
        path: The file.
        limits: Limits of the file.

    Raises:
        EsiError: The file cannot be read, is too large, or has an encoding that is not supported.
    """
    name = str(path)
    try:
        with open(path, "rb", opener=_open_without_waiting) as stream:
            status = os.fstat(stream.fileno())
            if not S_ISREG(status.st_mode):
                raise EsiError("not a regular file", file=name)
            _check_size(status.st_size, name, limits)
            data = stream.read(limits.file_size + 1)
    except (OSError, ValueError) as error:
        raise EsiError(f"cannot be read: {error}", file=name) from None
    return make_document(data, name, limits)


def make_document(data: bytes, file: str, limits: Limits = LIMITS) -> Document:
    """Return the bytes of a file as a document with its encoding and warnings.

    Args:
        data: The bytes of the file.
        file: The name of the file for messages.
        limits: Limits of the file.

    Raises:
        EsiError: The file is too large, or has an encoding that is not supported.
    """
    _check_size(len(data), file, limits)
    try:
        choice = choose_encoding(data)
    except ValueError as error:
        raise EsiError(str(error), file=file, hint="save the file in UTF-8") from None
    warnings = [_warning(file, data, offset, text) for offset, text in choice.warnings]
    data, mark = without_faults(data, choice.encoding), choice.mark
    if choice.encoding.unit == 1:
        control = FORBIDDEN.search(data)
        if control is not None:
            text = f"control character 0x{data[control.start()]:02X} replaced by a blank"
            warnings.append(_warning(file, data, control.start(), text))
            data = data.translate(BLANKS)
        mark = len(data) - len(data[mark:].lstrip(b" \t\r\n"))
    line = 1 + data.count(b"\n", 0, mark)
    return Document(file, data, choice.encoding, mark, line, tuple(warnings))


def make_fragment(data: bytes, encoding: Encoding, *, file: str, line: int) -> Document:
    """Return the bytes of one element as a document.

    Args:
        data: The bytes of the element.
        encoding: The encoding of the file.
        file: The name of the file for messages.
        line: The line of the element in the file.
    """
    data = without_faults(data, encoding)
    if encoding.unit == 1 and FORBIDDEN.search(data):
        data = data.translate(BLANKS)
    return Document(file, data, encoding.for_bytes(data), line=line)


def _open_without_waiting(path: str, flags: int) -> int:
    """Open a file. A named pipe does not block."""
    return os.open(path, flags | os.O_NONBLOCK)


def _check_size(size: int, file: str, limits: Limits) -> None:
    if size > limits.file_size:
        raise EsiError(f"{size} bytes; the limit is {limits.file_size} bytes", file=file)


def _warning(file: str, data: bytes, offset: int, text: str) -> EsiWarning:
    return EsiWarning(Source(file, 1 + data.count(b"\n", 0, offset)), text)
