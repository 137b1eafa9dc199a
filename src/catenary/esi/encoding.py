"""Character encoding of ESI files.

Vendors' files declare an encoding that expat does not support (gb2312, shift_jis), a wrong one, or
none. Nothing is re-encoded: expat parses the bytes of the file as they are, so that byte offsets
and lines are those of the file. For an encoding that expat does not support, it parses each byte as
one ISO 8859-1 character, and `Encoding.text` decodes names and texts afterwards. This is valid
because the characters of XML markup are never part of a longer character in these encodings.
"""

from __future__ import annotations

import codecs
import re
from typing import NamedTuple

PIECE = 1 << 20  # bytes that are decoded at once while an encoding is chosen
DECLARATION = re.compile(rb"""^\s*<\?xml[^>]{0,400}?encoding\s*=\s*["']([^"'>]{1,60})["']""")
KANA = re.compile("[\u3041-\u30ff]")  # Japanese text contains them
RUN = re.compile("[\x00-\xff]+")
# Supersets: files that declare the smaller set use characters of the larger one.
CODECS = {
    "gb2312": "gb18030",
    "gbk": "gb18030",
    "gb18030": "gb18030",
    "shift_jis": "cp932",
    "cp932": "cp932",
    "big5": "cp950",
    "cp950": "cp950",
    "euc_jp": "euc_jp",
    "euc_kr": "cp949",
    "cp949": "cp949",
}
NAMES = {
    "gb_2312-80": "gb2312",
    "x-gbk": "gbk",
    "x-sjis": "shift_jis",
    "windows-31j": "cp932",
    "ansi": "cp1252",
    "unicode": "utf-16",
}
SINGLE_BYTE = re.compile(r"iso8859-\d+|cp125\d|cp437|cp850|koi8-[ru]|mac-roman")
TRANSPORTS = {"utf-8": "UTF-8", "utf-16-le": "UTF-16LE", "utf-16-be": "UTF-16BE"}
BYTEWISE = "ISO-8859-1"
MARKS = (  # UTF-32 first: its mark begins with that of UTF-16
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


class Encoding(NamedTuple):
    """Encoding of a file: the name of the Python codec, and the name that expat receives."""

    name: str
    transport: str

    def for_bytes(self, data: bytes) -> Encoding:
        """Return the encoding for an element: byte by byte if UTF-8 has faulty characters."""
        if self.transport == "UTF-8" and _try(data, self.name).faults:
            return Encoding(self.name, BYTEWISE)
        return self

    def text(self, parsed: str) -> str:
        """Return the text of characters that expat parsed."""
        if parsed.isascii() or self.transport != BYTEWISE:
            return parsed
        # Character references may denote characters above 0xFF; these are already decoded.
        return RUN.sub(lambda run: run[0].encode("latin-1").decode(self.name, "replace"), parsed)

    @property
    def unit(self) -> int:
        """Size of the smallest character [bytes]."""
        return 2 if self.name.startswith("utf-16") else 1


class Choice(NamedTuple):
    """Result of `choose_encoding`: the length of the byte-order mark, and warnings by offset."""

    encoding: Encoding
    mark: int
    warnings: tuple[tuple[int, str], ...]


class _Trial(NamedTuple):
    """Result of a trial: characters outside ASCII, faults among them, offset of the first."""

    characters: int
    faults: int
    first: int
    kana: bool


def encoding_by_name(name: str) -> Encoding | None:
    """Return a supported encoding; None if the name is unknown or not supported."""
    name = name.strip().lower()
    try:
        normal = codecs.lookup(NAMES.get(name, name)).name
    except (LookupError, ValueError):
        return None
    normal = "cp1252" if normal == "ascii" else CODECS.get(normal, normal)
    if normal in TRANSPORTS:
        return Encoding(normal, TRANSPORTS[normal])
    if normal in CODECS.values() or SINGLE_BYTE.fullmatch(normal):
        return Encoding(normal, BYTEWISE)
    return None


def choose_encoding(data: bytes) -> Choice:
    """Return the encoding of a file, the length of its byte-order mark, and warnings.

    A byte-order mark decides. Otherwise, the declared encoding applies if it decodes the file, or
    if most characters are valid in it. Otherwise, the bytes decide. A file that is valid UTF-8 is
    read as UTF-8, even if it declares another 8-bit encoding.

    Raises:
        ValueError: The file is in UTF-32, which expat does not support.
    """
    mark, marked = next(((mark, name) for mark, name in MARKS if data.startswith(mark)), (b"", ""))
    name = marked or _wide(data)
    if name == "utf-32":
        raise ValueError("the file is encoded in UTF-32")
    if name.startswith("utf-16"):
        return Choice(Encoding(name, TRANSPORTS[name]), len(mark), _wide_warnings(data, name, mark))
    found = DECLARATION.match(data[len(mark) : len(mark) + 1024])
    declared = found[1].decode("latin-1") if found and not marked else ""
    encoding, warnings = _fitting(data, declared)
    return Choice(encoding, len(mark), warnings)


def without_faults(data: bytes, encoding: Encoding) -> bytes:
    """Return UTF-16 with faulty characters replaced; other encodings unchanged.

    The result has the length of the original bytes, except for half a character at the end.

    Args:
        data: The bytes.
        encoding: Their encoding.
    """
    if encoding.unit == 1:
        return data
    try:
        data.decode(encoding.name)
        return data
    except UnicodeDecodeError:
        whole = data[: len(data) & ~1]
        return whole.decode(encoding.name, "replace").encode(encoding.name)


def _wide(data: bytes) -> str:
    """Return the name of UTF-16 without a byte-order mark; empty for other encodings."""
    return {b"<\0": "utf-16-le", b"\0<": "utf-16-be"}.get(data[:2], "")


def _wide_warnings(data: bytes, name: str, mark: bytes) -> tuple[tuple[int, str], ...]:
    trial = _try(data[len(mark) :], name)
    if not trial.faults:
        return ()
    return ((len(mark) + trial.first, f"{trial.faults} faulty characters in UTF-16 were replaced"),)


def _fitting(data: bytes, declared: str) -> tuple[Encoding, tuple[tuple[int, str], ...]]:
    """Return the encoding that decodes the bytes, and warnings."""
    wanted = encoding_by_name(declared or "utf-8")
    if wanted is None or wanted.unit > 1:  # UTF-16 in a file of 8-bit characters
        wanted = None
    if wanted is not None and wanted.transport == BYTEWISE and _is_utf_8(data, wanted):
        text = f"the declared encoding {declared!r} does not fit the bytes; read as utf-8"
        return Encoding("utf-8", TRANSPORTS["utf-8"]), ((0, text),)
    trial = _try(data, wanted.name) if wanted is not None else None
    if wanted is not None and trial is not None and not trial.faults:
        return wanted, ()
    if wanted is not None and trial is not None and 4 * trial.faults <= trial.characters:
        text = f"{trial.faults} characters are not valid in {wanted.name} and were replaced"
        return Encoding(wanted.name, BYTEWISE), ((trial.first, text),)
    used = _guess(data)
    faulty = trial.first if trial is not None else 0
    cause = f"the declared encoding {declared!r}" if declared else "UTF-8, the default encoding,"
    reason = "does not fit the bytes" if wanted is not None else "cannot be used for this file"
    faults = _try(data, used.name).faults
    lost = f"; {faults} characters were replaced" if faults else ""
    return used, ((faulty, f"{cause} {reason}; read as {used.name}{lost}"),)


def _is_utf_8(data: bytes, declared: Encoding) -> bool:
    """Return True if a file is UTF-8 although it declares another encoding.

    A few Chinese characters in GBK can be valid UTF-8 too.
    """
    trial = _try(data, "utf-8")
    least = 1 if SINGLE_BYTE.fullmatch(declared.name) else 4
    return not trial.faults and trial.characters >= least


def _guess(data: bytes) -> Encoding:
    """Return the most probable encoding of bytes without a usable declaration."""
    for strict, name in (("utf-8", "utf-8"), ("gb2312", "gb18030")):
        if not _try(data, strict).faults:
            return Encoding(name, TRANSPORTS.get(name, BYTEWISE))
    japanese = _try(data, "cp932")
    if japanese.kana and not japanese.faults:
        return Encoding("cp932", BYTEWISE)
    return Encoding("cp1252", BYTEWISE)


def _try(data: bytes, name: str) -> _Trial:
    """Decode the bytes piece by piece, and count the characters that are not valid."""
    decoder = codecs.getincrementaldecoder(name)("replace")
    characters, faults, first, kana = 0, 0, 0, False
    for start in range(0, len(data), PIECE):
        piece = data[start : start + PIECE]
        if piece.isascii() and decoder.getstate()[0] == b"" and not name.startswith("utf-16"):
            continue
        text = decoder.decode(piece, start + PIECE >= len(data))
        characters += len(text) - len(text.encode("ascii", "ignore"))
        found = text.count("\ufffd")
        if found and not faults:
            first = start + len(text[: text.index("\ufffd")].encode(name, "ignore"))
        faults += found
        kana = kana or KANA.search(text) is not None
    return _Trial(characters, faults, min(first, len(data)), kana)
