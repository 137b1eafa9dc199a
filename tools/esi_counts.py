#!/usr/bin/env python3
"""Count the features of ESI files.

usage: tools/esi_counts.py FILE|FOLDER ...

Prints one table: how many files and devices have each feature. Then lists the files that cannot be
read, with their errors. Exit status: 0, or 1 if no file could be read.
"""

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from catenary.errors import EsiError
from catenary.esi.device import EsiDevice, EsiFile
from catenary.esi.document import Document, open_document
from catenary.esi.reader import read_document
from catenary.wire.sii import MailboxProtocol

SUFFIXES = {".xml", ".esi"}


def _entries(device: EsiDevice, test: Callable[..., object]) -> bool:
    return any(test(entry) for pdo in device.pdos for entry in pdo.entries)


def _objects(device: EsiDevice, test: Callable[..., object]) -> bool:
    found = device.dictionary.objects.values() if device.dictionary is not None else ()
    return any(test(entry) for each in found for entry in each.entries)


def _speaks(protocol: MailboxProtocol) -> Callable[[EsiDevice], bool]:
    return lambda device: device.mailbox is not None and protocol in device.mailbox.protocols


FILE_FEATURES: dict[str, Callable[[Document, EsiFile], object]] = {
    "no XML declaration": lambda document, _: b"<?xml" not in document.data[:100],
    "byte-order mark": lambda document, _: document.mark and document.line == 1,
    "not UTF-8": lambda document, _: document.encoding.name != "utf-8",
    "references to other files": lambda _, file: file.references,
    "modules": lambda _, file: file.modules,
    "dictionary file": lambda _, file: file.dictionary,
    "warnings of the file": lambda _, file: file.warnings,
}
DEVICE_FEATURES: dict[str, Callable[[EsiDevice], object]] = {
    "CheckRevisionNo": lambda device: device.revision_check,
    "HideType": lambda device: device.hides,
    "UseLrdLwr": lambda device: device.use_lrd_lwr,
    "SyncManager: virtual": lambda device: any(sm.virtual for sm in device.sync_managers),
    "SyncManager: OpOnly": lambda device: any(sm.op_only for sm in device.sync_managers),
    "PDOs": lambda device: device.pdos,
    "PDO: not assigned": lambda device: any(pdo.sync_manager is None for pdo in device.pdos),
    "PDO: not fixed": lambda device: any(not pdo.fixed for pdo in device.pdos),
    "PDO: mandatory": lambda device: any(pdo.mandatory for pdo in device.pdos),
    "PDO: excludes": lambda device: any(pdo.excludes for pdo in device.pdos),
    "PDO: virtual": lambda device: any(pdo.virtual for pdo in device.pdos),
    "PDO: oversampling": lambda device: any(pdo.oversampling_max for pdo in device.pdos),
    "entry: gap": lambda device: _entries(device, lambda entry: not entry.index),
    "entry: 0 bits": lambda device: _entries(device, lambda entry: not entry.bit_length),
    "alternative mappings": lambda device: device.alternative_mappings,
    "mailbox": lambda device: device.mailbox,
    **{f"mailbox: {each.name}": _speaks(each) for each in MailboxProtocol},
    "CoE: complete access": lambda device: device.mailbox and device.mailbox.complete_access,
    "CoE: PdoAssign": lambda device: device.mailbox and device.mailbox.pdo_assign,
    "CoE: PdoConfig": lambda device: device.mailbox and device.mailbox.pdo_configuration,
    "CoE: InitCmd": lambda device: device.mailbox and device.mailbox.init_commands,
    "distributed clocks": lambda device: device.has_clock,
    "OpMode: with SYNC0": lambda device: any(m.assign_activate & 0x200 for m in device.op_modes),
    "OpMode: with Sm": lambda device: any(mode.sync_managers for mode in device.op_modes),
    "dictionary": lambda device: device.dictionary,
    "dictionary: in a file": lambda device: device.dictionary_file,
    "dictionary: default values": lambda device: _objects(device, lambda entry: entry.default),
    "dictionary: units": lambda device: _objects(device, lambda entry: entry.unit is not None),
    "dictionary: enumerations": lambda device: _objects(device, lambda e: e.enumeration),
    "slots": lambda device: device.slots,
    "timeouts": lambda device: device.timeouts.pre_op,
    "watchdog registers": lambda device: device.watchdog.divider or device.watchdog.sync_managers,
    "EEPROM": lambda device: device.eeprom,
    "EEPROM: categories": lambda device: device.eeprom and device.eeprom.categories,
    "EEPROM: whole image": lambda device: device.eeprom and device.eeprom.data,
    "unknown elements": lambda device: device.unknown,
    "warnings": lambda device: device.warnings,
}


def esi_files(arguments: list[str]) -> Iterator[Path]:
    """Yield the files, and the files in the folders."""
    for path in map(Path, arguments):
        if path.is_dir():
            yield from sorted(each for each in path.rglob("*") if each.suffix.lower() in SUFFIXES)
        else:
            yield path


def count(paths: Iterator[Path]) -> tuple[Counter[str], Counter[str], list[str]]:
    """Return the counts of files and devices by feature, and the errors."""
    files: Counter[str] = Counter()
    devices: Counter[str] = Counter()
    errors, identities = [], set()
    for path in paths:
        try:
            document = open_document(path)
            file = read_document(document)
        except EsiError as error:
            errors.append(error.message)
            continue
        files["files"] += 1
        files.update(name for name, test in FILE_FEATURES.items() if test(document, file))
        for device in file.devices:
            devices["devices"] += 1
            identities.add(device.key)
            devices.update(name for name, test in DEVICE_FEATURES.items() if test(device))
    devices["identities"] = len(identities)
    return files, devices, errors


def table(files: Counter[str], devices: Counter[str]) -> str:
    """Return the counts as lines: first of files, then of devices."""
    rows = [(name, files[name]) for name in ("files", *FILE_FEATURES)]
    rows += [(name, devices[name]) for name in ("devices", "identities", *DEVICE_FEATURES)]
    return "\n".join(f"{name:<28} {number:>6}" for name, number in rows)


def main(arguments: list[str]) -> int:
    """Print the table, then the files that cannot be read."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(__doc__.strip())
        return 0
    files, devices, errors = count(esi_files(arguments))
    print(table(files, devices))
    for error in errors:
        print(f"refused: {error}")
    return 0 if files["files"] else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
