"""Objects of the PDO mapping, ETG.1000.6 §5.6.7.4, and their entries in complete access."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.capture.mailbox_contents import SdoTransfer

PDOS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))
ASSIGNMENTS = range(0x1C10, 0x1C30)  # + number of the SyncManager
_ENTRY_SIZE, _ASSIGNED_SIZE = 4, 2  # bytes of an entry
_COUNT_SIZE = 2  # of subindex 0 in complete access, with one byte of padding


def is_mapping(index: int) -> bool:
    """Return True for a PDO and for an assignment of PDOs to a SyncManager."""
    return index in ASSIGNMENTS or any(index in each for each in PDOS)


def entries(transfer: SdoTransfer) -> Iterator[tuple[int, bytes]]:
    """Yield the subindices that a transfer writes or reads, with their values.

    A complete access is divided for the mapping only: the types of other objects are unknown.
    Their value is that of the first subindex.
    """
    if not (transfer.complete_access and is_mapping(transfer.index)):
        yield transfer.subindex, transfer.data
        return
    data = transfer.data
    if transfer.subindex == 0:
        if not data:
            return
        yield 0, data[:1]
        data = data[_COUNT_SIZE : _COUNT_SIZE + data[0] * _size(transfer.index)]
    size = _size(transfer.index)
    for number in range(len(data) // size):
        yield number + 1, data[number * size : (number + 1) * size]


def _size(index: int) -> int:
    return _ASSIGNED_SIZE if index in ASSIGNMENTS else _ENTRY_SIZE
