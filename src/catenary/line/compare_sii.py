"""Comparison of two EEPROM images: fields of the header, then categories, ETG.1000.6 §5.4.

The identity is left out, because it is a change of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from catenary.errors import DecodeError
from catenary.line.change import ABSENT, Change, Part, Severity
from catenary.line.sides import Sides
from catenary.line.value_text import bytes_texts
from catenary.wire.sii import (
    CATEGORY_HEADER_SIZE,
    END_OF_CATEGORIES,
    HEADER_SIZE,
    MAXIMUM_CATEGORIES,
    CategoryType,
    decode_category_header,
)
from catenary.wire.sii_categories import Pdo, decode_pdos, decode_strings

_FIELDS = (  # first word, number of words, name
    (0x00, 1, "PDI control"),
    (0x01, 1, "PDI configuration"),
    (0x02, 1, "pulse length of SYNC signals"),
    (0x03, 1, "extended PDI configuration"),
    (0x05, 2, "reserved words"),
    (0x10, 4, "delays of the ports"),
    (0x14, 2, "bootstrap receive mailbox"),
    (0x16, 2, "bootstrap send mailbox"),
    (0x18, 2, "receive mailbox"),
    (0x1A, 2, "send mailbox"),
    (0x1C, 1, "mailbox protocols"),
    (0x1D, 0x21, "reserved words"),
    (0x3E, 1, "size"),
    (0x3F, 1, "version"),
)
_ALIAS, _CHECKSUM = (0x04, 1, "station alias"), (0x07, 1, "checksum")
_CHECKSUM_END = 0x07  # the checksum covers the words before it
_NAMES = {
    CategoryType.STRINGS: "strings",
    CategoryType.DATA_TYPES: "data types",
    CategoryType.GENERAL: "general",
    CategoryType.FMMU: "FMMUs",
    CategoryType.SYNC_MANAGER: "SyncManagers",
    CategoryType.FMMU_EXTENDED: "extended FMMUs",
    CategoryType.SYNC_UNIT: "sync units",
    CategoryType.TXPDO: "TxPDOs",
    CategoryType.RXPDO: "RxPDOs",
    CategoryType.DISTRIBUTED_CLOCKS: "distributed clocks",
}
_PDOS = {CategoryType.TXPDO: "TxPDO", CategoryType.RXPDO: "RxPDO"}
_Key = tuple[int, int]  # type, and number among the categories of this type


def compare_sii(sides: Sides) -> Iterator[Change]:
    """Yield the changes between two images that were both read.

    Args:
        sides: The device, with both images.
    """
    old, new = sides.old.sii or b"", sides.new.sii or b""
    if old == new:
        return
    yield from _header(sides, old, new)
    categories, rest = _split(old)
    present, present_rest = _split(new)
    for key in dict.fromkeys((*categories, *present)):
        yield from _category(sides, key, categories, present)
    if rest != present_rest:
        texts = bytes_texts(rest, present_rest)
        yield sides.change(Part.SII, "bytes after the categories", texts, Severity.INFO)


def stored_alias(image: bytes) -> bytes:
    """Return the station alias in an image."""
    return _words(image, *_ALIAS[:2])


def _header(sides: Sides, old: bytes, new: bytes) -> Iterator[Change]:
    found = []
    for first, count, name in (_ALIAS, *_FIELDS):
        before, now = _words(old, first, count), _words(new, first, count)
        if before == now:
            continue
        found.append(first)
        if first == _ALIAS[0]:
            numbers = (str(int.from_bytes(each, "little")) for each in (before, now))
            yield sides.change(Part.ALIAS, "", (next(numbers), next(numbers)))
        else:
            what = f"word 0x{first:04X} {name}"
            yield sides.change(Part.SII, what, bytes_texts(before, now))
    before, now = _words(old, *_CHECKSUM[:2]), _words(new, *_CHECKSUM[:2])
    if before != now and not any(first < _CHECKSUM_END for first in found):
        yield sides.change(Part.SII, "word 0x0007 checksum", bytes_texts(before, now))


def _words(image: bytes, first: int, count: int) -> bytes:
    return image[2 * first : 2 * (first + count)]


def _split(image: bytes) -> tuple[dict[_Key, bytes], bytes]:
    """Return the categories, and the bytes after them without padding.

    A damaged image is not an error.
    """
    found: dict[_Key, bytes] = {}
    numbers: Counter[int] = Counter()
    offset = HEADER_SIZE
    while offset + CATEGORY_HEADER_SIZE <= len(image) and len(found) < MAXIMUM_CATEGORIES:
        kind, size = decode_category_header(image[offset : offset + CATEGORY_HEADER_SIZE])
        start = offset + CATEGORY_HEADER_SIZE
        if kind == END_OF_CATEGORIES or start + size > len(image):
            break
        found[kind, numbers[kind]] = image[start : start + size]
        numbers[kind] += 1
        offset = start + size
    return found, image[offset:].rstrip(b"\xff")


def _category(
    sides: Sides, key: _Key, old: Mapping[_Key, bytes], new: Mapping[_Key, bytes]
) -> Iterator[Change]:
    before, now = old.get(key), new.get(key)
    if before == now:
        return
    kind, number = key
    name = _NAMES[CategoryType(kind)] if kind in _NAMES else f"0x{kind:04X}"
    what = f"category {name}" + (f" {number + 1}" if number else "")
    severity = Severity.INFO if kind == CategoryType.STRINGS else Severity.EFFECT
    if before is None or now is None:
        texts = _size(before), _size(now)
        yield sides.change(Part.SII, what, texts, severity)
        return
    try:
        yield from _decoded(sides, kind, before, now)
    except DecodeError:
        yield sides.change(Part.SII, what, bytes_texts(before, now), severity)


def _size(data: bytes | None) -> str:
    return ABSENT if data is None else f"{len(data)} bytes"


def _decoded(sides: Sides, kind: int, old: bytes, new: bytes) -> Iterator[Change]:
    """Yield the changed strings or PDOs; else the changed words."""
    found: list[Change] = []
    severity = Severity.EFFECT
    if kind == CategoryType.STRINGS:
        severity = Severity.INFO
        found += _strings(sides, old, new)
    elif kind in _PDOS:
        found += _pdos(sides, _PDOS[CategoryType(kind)], old, new)
    if found:
        yield from found
        return
    name = _NAMES[CategoryType(kind)] if kind in _NAMES else f"0x{kind:04X}"
    for word in range(0, max(len(old), len(new)), 2):
        before, now = old[word : word + 2], new[word : word + 2]
        if before != now:
            texts = _word(before), _word(now)
            yield sides.change(Part.SII, f"category {name}, word {word // 2}", texts, severity)


def _word(data: bytes) -> str:
    return f"0x{int.from_bytes(data, 'little'):04X}" if data else ABSENT


def _strings(sides: Sides, old: bytes, new: bytes) -> Iterator[Change]:
    before, now = decode_strings(old), decode_strings(new)
    for number in range(max(len(before), len(now))):
        texts = tuple(
            f'"{each[number]}"' if number < len(each) else ABSENT for each in (before, now)
        )
        if texts[0] != texts[1]:
            what = f"string {number + 1}"
            yield sides.change(Part.SII, what, (texts[0], texts[1]), Severity.INFO)


def _pdos(sides: Sides, name: str, old: bytes, new: bytes) -> Iterator[Change]:
    before, now = ({pdo.index: pdo for pdo in decode_pdos(each)} for each in (old, new))
    for index in sorted({*before, *now}):
        texts = _pdo_text(before.get(index)), _pdo_text(now.get(index))
        if texts[0] != texts[1]:
            yield sides.change(Part.SII, f"{name} 0x{index:04X}", texts)


def _pdo_text(pdo: Pdo | None) -> str:
    if pdo is None:
        return ABSENT
    manager = "" if pdo.sync_manager == 0xFF else f"SyncManager {pdo.sync_manager}: "
    entries = (f"0x{e.index:04X}:{e.subindex:02X} {e.bit_length}" for e in pdo.entries)
    return manager + (", ".join(entries) or "no entries")
