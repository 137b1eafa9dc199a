"""`catenary reg read|write`: access registers and memory of a device."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from catenary.cli import share_target
from catenary.cli.arguments import number, positive_number
from catenary.cli.failure import UsageError
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_position,
    add_target,
    note_other_masters,
)

if TYPE_CHECKING:
    from catenary.wire.register_names import AnyRegister

LARGEST = 1024  # largest access [bytes]; it fits into one frame
SHOWN_AS_NUMBER = (1, 2, 4, 8)
DUMP_WIDTH = 16


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "reg",
        help="read or write registers of a device",
        description="Reads or writes registers and memory of a device. The command itself "
        "does not change the EtherCAT state.",
        example="catenary reg read eth0 2 AL_STATUS\ncatenary reg write eth0 2 0x0310 0 --size 4",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_read(group)
    _add_write(group)


def _add_read(group: Commands) -> None:
    reading = add_command(
        group,
        "read",
        help="read a register",
        description="Reads a register and explains its content. ADDRESS is a number or a name "
        "(AL_STATUS, dl-status, fmmu0, 'SyncManager 2'). SIZE in bytes is optional for a known "
        "register.",
        example="catenary reg read eth0 2 AL_STATUS\n"
        "catenary reg read eth0 2 0x0300 20\n"
        "catenary reg read virtual 2 fmmu0 --json",
    )
    _add_place(reading)
    reading.add_argument(
        "size", metavar="SIZE", nargs="?", type=positive_number, help="size in bytes"
    )
    add_json(reading)
    reading.set_defaults(run=run_read)


def _add_write(group: Commands) -> None:
    writing = add_command(
        group,
        "write",
        help="write a register",
        description="Writes a register. VALUE is a number with the size of the register or --size, "
        "or bytes as pairs of hexadecimal digits with spaces ('01 02 0a').",
        example="catenary reg write eth0 2 watchdog-divider 2498\n"
        "catenary reg write eth0 2 0x0300 0 --size 1\n"
        "catenary reg write eth0 2 0x1000 '01 02 0a'",
    )
    _add_place(writing)
    writing.add_argument("value", metavar="VALUE", help="2498, 0x9C2 or '01 02 0a'")
    writing.add_argument(
        "--size", metavar="BYTES", type=positive_number, help="size of a numeric VALUE"
    )
    add_force(writing)
    add_json(writing)
    writing.set_defaults(run=run_write)


def _add_place(parser: argparse.ArgumentParser) -> None:
    add_target(parser)
    add_position(parser)
    parser.add_argument("address", metavar="ADDRESS", help="0x0130 or AL_STATUS")


def run_read(arguments: argparse.Namespace) -> int:
    address, size, register = place(arguments.address, arguments.size)
    if size is None:
        raise UsageError(
            f"no known register starts at 0x{address:04X}", hint="give the number of bytes: SIZE"
        )
    _check(address, size)
    data = _read(arguments, address, size)
    print(as_json(arguments, address, register, data) if arguments.json else show(register, data))
    return 0


def _read(arguments: argparse.Namespace, address: int, size: int) -> bytes:
    from catenary.cli.devices import device_at
    from catenary.procedure.registers import read_register
    from catenary.target import MainDevice

    if share_target.names_share(arguments.target):
        return share_target.read_register(arguments, address, size)
    with MainDevice(arguments.target, force=True) as main:  # this command only reads
        note_other_masters(main)
        device = device_at(main.passive_scan(names=False), arguments.position)
        arguments.position = device.position
        return main.converse(read_register(device.station, address, size))


def run_write(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.procedure.registers import write_register
    from catenary.target import MainDevice

    address, size, register = place(arguments.address, arguments.size)
    data = value_bytes(arguments.value, size, address)
    _check(address, len(data))
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = device_at(main.passive_scan(names=False), arguments.position)
        arguments.position = device.position
        main.converse(write_register(device.station, address, data))
    if arguments.json:
        print(as_json(arguments, address, register, data))
    return 0


def place(text: str, size: int | None) -> tuple[int, int | None, AnyRegister | None]:
    """Parse ADDRESS into address, size and register; size and register are None if unknown."""
    from catenary.wire.register_names import at_address, by_name, names, near

    if text[:1].isdigit():
        try:
            address = number(text)
        except argparse.ArgumentTypeError as error:
            raise UsageError(str(error), hint=f"write 0x{text}" if _is_hex(text) else "") from error
        register = at_address(address, size)
        return address, size or (register.size if register else None), register
    try:
        register = by_name(text)
    except ValueError as error:
        hint = "or give its address, such as 0x0130"
        if not near(text):
            hint = f"names: {'; '.join(numbered(names()))}"
        raise UsageError(str(error), hint=hint) from error
    if size not in (None, register.size):
        raise UsageError(f"{register} has {register.size} bytes, not {size}", hint="omit the size")
    return register.address, register.size, register


def numbered(names: Iterable[str]) -> Iterator[str]:
    """Yield the names in order, with "FMMU 0" ... "FMMU 15" combined into "FMMU 0 to 15"."""
    families: dict[str, list[str]] = {}
    for name in names:
        families.setdefault(re.sub(r" \d+(?= |$)", " #", name), []).append(name)
    for family, members in families.items():
        numbers = [int(each) for name in members for each in re.findall(r" (\d+)(?= |$)", name)]
        several = len(members) > 1
        yield family.replace("#", f"{min(numbers)} to {max(numbers)}") if several else members[0]


def value_bytes(text: str, size: int | None, address: int) -> bytes:
    """Return the bytes of a value: a number of `size` bytes, or pairs of hexadecimal digits."""
    if " " in text.strip():
        try:
            data = bytes.fromhex(text)
        except ValueError:
            raise UsageError(f"{text!r} is not a list of pairs of hexadecimal digits") from None
        if size not in (None, len(data)):
            raise UsageError(
                f"VALUE has {len(data)} bytes, but the size at 0x{address:04X} is {size} bytes"
            )
        return data
    try:
        value = number(text)
    except argparse.ArgumentTypeError as error:
        raise UsageError(str(error)) from error
    if size is None:
        raise UsageError(
            f"no known register starts at 0x{address:04X}, so the size of {text} is unknown",
            hint="add --size BYTES, or give the bytes: '01 02'",
        )
    try:
        return value.to_bytes(size, "little", signed=value < 0)
    except OverflowError:
        raise UsageError(f"{text} does not fit into {size} bytes") from None


def _check(address: int, size: int) -> None:
    if not 0 <= address <= 0xFFFF or address + size > 0x10000:
        raise UsageError(f"0x{address:04X} + {size} bytes is outside 0x0000 to 0xFFFF")
    if size > LARGEST:
        raise UsageError(f"{size} bytes exceed the largest access of {LARGEST} bytes")


def _is_hex(text: str) -> bool:
    return all(letter in "0123456789abcdefABCDEF" for letter in text)


def show(register: AnyRegister | None, data: bytes) -> str:
    """Return the content of a register as text."""
    from catenary.wire.register_text import explain

    name = f"{register}:" if register else ""
    if len(data) in SHOWN_AS_NUMBER:
        value = int.from_bytes(data, "little")
        content = f"{data.hex(' ')}  (0x{value:0{2 * len(data)}X}, {value})"
    elif len(data) <= DUMP_WIDTH:
        content = data.hex(" ")
    else:
        content = "".join(
            f"\n  {start:04x}  {data[start : start + DUMP_WIDTH].hex(' ')}"
            for start in range(0, len(data), DUMP_WIDTH)
        )
    meaning = explain(register, data) if register else None
    lines = [f"{name} {content}".strip(" ").removeprefix("\n")]
    return "\n".join([*lines, f"  {meaning}"] if meaning else lines)


def as_json(
    arguments: argparse.Namespace, address: int, register: AnyRegister | None, data: bytes
) -> str:
    from catenary.wire.register_text import explain

    return json.dumps(
        {
            "position": arguments.position,
            "address": address,
            "size": len(data),
            "name": register.name if register else None,
            "data": data.hex(),
            "value": int.from_bytes(data, "little") if len(data) in SHOWN_AS_NUMBER else None,
            "meaning": explain(register, data) if register else None,
        }
    )
