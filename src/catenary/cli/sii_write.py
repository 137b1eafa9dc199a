"""`catenary sii write`: write an image into the EEPROM of a device."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.parsers import Commands, add_command, add_json, add_position, add_target

if TYPE_CHECKING:
    from catenary.bus import MainDevice, SubDevice
    from catenary.procedure.sii_size import Extent


def add_write(group: Commands) -> None:
    writing = add_command(
        group,
        "write",
        help="write an image into the EEPROM",
        description="Checks FILE (length, checksum, categories, size of the EEPROM, identity), "
        "shows the differences, writes the words that differ and reads them back. The device "
        "uses them after its next power cycle.",
        example="catenary sii read eth0 2 -o before.bin\n"
        "catenary sii write eth0 2 drive.bin --dry-run\n"
        "catenary sii write eth0 2 drive.bin",
    )
    add_target(writing)
    add_position(writing)
    writing.add_argument("file", metavar="FILE", type=Path, help="file with the binary image")
    writing.add_argument(
        "--dry-run", action="store_true", help="show the differences without writing"
    )
    writing.add_argument(
        "--force", action="store_true", help="write despite a fault that can be ignored"
    )
    add_json(writing)
    writing.set_defaults(run=run_write)


def run_write(arguments: argparse.Namespace) -> int:
    from catenary.bus.eeprom import read_eeprom, write_eeprom
    from catenary.cli.devices import device_at
    from catenary.cli.progress import Progress
    from catenary.procedure.sii_owner import with_eeprom
    from catenary.procedure.sii_size import read_extent
    from catenary.procedure.sii_write import changes
    from catenary.target import MainDevice

    image = arguments.file.read_bytes()
    check_image(image, arguments)
    with MainDevice(arguments.target) as main:
        device = device_at(main.passive_scan(), arguments.position)
        station = device.station
        extent = main.converse(with_eeprom(station, read_extent(station)))
        check_fit(image, device, extent, arguments.force)
        with Progress("read") as progress:
            old = read_eeprom(main, station, len(image), progress=progress)
        needed = changes(old, image)
        lines = report(device, old, image, len(needed))
        if not arguments.json:
            print("\n".join(lines))
        writes = bool(needed) and not arguments.dry_run
        if writes:
            with Progress("write") as progress:
                write_eeprom(main, station, needed, progress=progress)
            verify(main, device, image)
    if arguments.json:
        values = {"position": device.position, "words": len(needed), "differences": lines[1:]}
        print(json.dumps(values | {"written": writes}, indent=2))
    elif writes:
        print(f"{len(needed)} words written and verified; power-cycle the device to use them")
    return 0


def check_image(image: bytes, arguments: argparse.Namespace) -> None:
    """Check that the image is valid. With --force, report some faults without raising.

    Raises:
        EepromError: The image has a fault that is not ignored.
    """
    from catenary.errors import EepromError
    from catenary.wire.sii_check import objections

    for each in objections(image):
        if each.insist and arguments.force:
            print(
                f"catenary: {arguments.file}: {each.text} (ignored because of --force)",
                file=sys.stderr,
            )
            continue
        more = "; --force writes it anyway" if each.insist else ""
        raise EepromError(f"{arguments.file}: {each.text}", hint=each.hint + more)


def check_fit(image: bytes, device: SubDevice, extent: Extent, force: bool) -> None:
    """Check that the image fits the device. With `force`, check only the addressable size.

    Raises:
        EepromError: The image is too large, or for another device.
    """
    from catenary.cli.sii_text import tolerant
    from catenary.errors import EepromError

    if len(image) > extent.limit:
        raise EepromError(
            f"{device.station}: the image has {len(image)} bytes, but the device can address "
            f"only {extent.limit} bytes of EEPROM",
            hint="use an image for this device",
        )
    if force:
        return
    if len(image) > extent.size and not extent.note:
        raise EepromError(
            f"{device.station}: the image has {len(image)} bytes, but the EEPROM has only "
            f"{extent.size} bytes",
            hint="use an image for this device, or --force if the size in its EEPROM is wrong",
        )
    new, now = tolerant(image).header, device.identity
    if now.vendor and (new.vendor, new.product) != (now.vendor, now.product) and not extent.note:
        raise EepromError(
            f"{device.station}: the image is for vendor 0x{new.vendor:08X} product "
            f"0x{new.product:08X}, the device is vendor 0x{now.vendor:08X} product "
            f"0x{now.product:08X}",
            hint="check POSITION; --force changes the device's identity",
        )


def report(device: SubDevice, old: bytes, new: bytes, words: int) -> list[str]:
    """Return the differences between the current and the new content as lines of text."""
    from catenary.cli.sii_text import differences, word_differences
    from catenary.errors import DecodeError

    if not words:
        return [f"{device.station}: its EEPROM already has this content"]
    lines = [f"{device.station}: {words} of {len(new) // 2} words differ"]
    try:
        return lines + differences(old, new)
    except DecodeError as error:  # one of the images is invalid
        return [*lines, f"cannot compare fields: {error.message}", *word_differences(old, new)]


def verify(main: MainDevice, device: SubDevice, image: bytes) -> None:
    """Read the EEPROM again and compare it with the image.

    Raises:
        EepromError: A word differs from the image.
    """
    from catenary.bus.eeprom import read_eeprom
    from catenary.cli.progress import Progress
    from catenary.errors import EepromError
    from catenary.procedure.sii_write import changes

    with Progress("verify") as progress:
        found = read_eeprom(main, device.station, len(image), progress=progress)
    wrong = changes(found, image)
    if wrong:
        raise EepromError(
            f"{device.station}: {len(wrong)} words differ after writing, the first at "
            f"0x{wrong[0].word:04X}",
            hint="write the image again; if the error persists, the EEPROM may be worn out",
        )
