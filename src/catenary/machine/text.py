"""Text of a machine file for the devices of a segment, with comments, for `catenary init`."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from catenary.machine.schema import FORMAT
from catenary.model.device import DeviceDescription, Direction, Entry
from catenary.types import BOOL, by_index

FILL_IN = "FILL IN"
UNSIGNED = {  # type by length [bits]
    **{8: "USINT", 16: "UINT", 24: "UINT24", 32: "UDINT"},
    **{40: "UINT40", 48: "UINT48", 56: "UINT56", 64: "ULINT"},
}
ENCODER = (0x608F, 1), (0x608F, 2)  # encoder counts, motor turns
HEAD = """\
# Written by `catenary init`. To compare this file with the segment, run `catenary check FILE`.
# A number is in SI units (rad, s, N·m). Text has a unit: "170 deg", "500 us", "90 rpm".
# Complete the lines marked {mark} and remove the "#" before them.
# All keys: docs/reference/machine_file.md
format = "{format}"
name = "machine"
target = {target}                      # cat.Machine(..., target="virtual:FILE.toml") overrides it

[loop]
period = "1 ms"

# Devices, in the order on the cable. You can rename them. A device is identified by its alias, or
# by its position if it has no alias. `catenary alias TARGET POSITION VALUE` writes an alias.
"""
DRIVES = """
# Axes. The options are those of cat.Drives. A list has one value per axis, in the order of `axes`.
[drives.axes]
axes = [{axes}]
mode = "csp"
{counts}
# gear_ratio = 1.0                    # motor turns per joint turn
# direction = 1                       # -1 if the joint turns opposite to the motor
# offset = "0 deg"                    # position of the joint where the drive reads 0
# position_min = "-170 deg"
# position_max = "170 deg"
# velocity_limit = "90 deg/s"         # {mark}: the default is 2π rad/s, with a warning
# torque_limit = 20                   # [N·m]
"""


def machine_text(
    devices: Sequence[DeviceDescription],
    target: str,
    encoders: Mapping[tuple[int, int], float],
) -> str:
    """Return the text of a machine file.

    Args:
        devices: all devices of the segment, read in PRE-OP.
        target: target of the segment, such as "eth0".
        encoders: encoder counts per turn by (position, slot), for drives that report them.
    """
    names = _names(devices)
    parts = [HEAD.format(mark=FILL_IN, format=FORMAT, target=quoted(target))]
    repeated = _repeated([device.alias for device in devices])
    for name, device in zip(names, devices, strict=True):
        parts.append(_device(name, device, has_alias=device.alias not in {0, *repeated}))
    parts.append(_drives(names, devices, encoders))
    parts += [_process_data(n, d) for n, d in zip(names, devices, strict=True) if not d.is_drive]
    return "".join(parts)


def _device(name: str, device: DeviceDescription, *, has_alias: bool) -> str:
    identity = device.identity
    address = f"alias = {device.alias}" if has_alias else f"position = {device.position}"
    label = ", ".join(part for part in (device.order, device.name) if part)
    return f"""
[[device]]                            # position {device.position}: {comment_text(label)}
name = "{name}"
{address}
identity = {{ vendor = 0x{identity.vendor:X}, product = 0x{identity.product:X}, \
revision = 0x{identity.revision:X} }}
# required = false                    # the device may be absent
"""


def _drives(
    names: Sequence[str],
    devices: Sequence[DeviceDescription],
    encoders: Mapping[tuple[int, int], float],
) -> str:
    axes = [
        (f'"{name}/{slot}"' if len(device.slots) > 1 else f'"{name}"', (device.position, slot))
        for name, device in zip(names, devices, strict=True)
        for slot in device.slots
    ]
    if not axes:
        return ""
    counts = [encoders.get(place) for _, place in axes]
    return DRIVES.format(
        mark=FILL_IN, axes=", ".join(text for text, _ in axes), counts=_counts(counts)
    )


def _counts(counts: Sequence[float | None]) -> str:
    known = [count for count in counts if count is not None]
    if len(known) < len(counts):
        value = "0                  "
        return f"# counts_per_turn = {value}# {FILL_IN}: encoder counts per motor turn"
    same = len(set(known)) == 1
    texts = [str(int(count)) if count == int(count) else str(count) for count in known]
    value = texts[0] if same else f"[{', '.join(texts)}]"
    return (
        f"# counts_per_turn = {value}          # {FILL_IN}: this value is from 0x608F of the drives"
    )


def _process_data(name: str, device: DeviceDescription) -> str:
    channels = _channels(device)
    outputs, inputs = channels[Direction.OUTPUT], channels[Direction.INPUT]
    if not outputs and not inputs:
        return ""
    text = f'\n[process_data.{name}]\ndevice = "{name}"\n'
    if outputs:
        first = next(iter(outputs))
        text += f"# safe = {{ {first} = 0 }}{' ' * 15}# sent when the loop ends; the default is 0\n"
    for heading, found in (("outputs", outputs), ("inputs", inputs)):
        if found:
            text += f"[process_data.{name}.{heading}]\n"
            text += "".join(f"{channel} = {value}\n" for channel, value in found.items())
    return text


def _channels(device: DeviceDescription) -> dict[Direction, dict[str, str]]:
    """Return the object of each mapped number, by a unique name."""
    found = [
        (direction, entry, pdo)
        for direction in (Direction.OUTPUT, Direction.INPUT)
        for entry, pdo in _entries(device, direction)
    ]
    short = [entry.name for _, entry, _ in found]
    unique = len(set(short)) == len(short)
    names = unique_names(
        [slug(e.name if unique else f"{pdo} {e.name}", "value") for _, e, pdo in found]
    )
    channels: dict[Direction, dict[str, str]] = {direction: {} for direction in Direction}
    for name, (direction, entry, _) in zip(names, found, strict=True):
        place = f'"0x{entry.index:04X}:{entry.subindex:02X}"'
        kind = _type_name(entry)
        channels[direction][name] = f'{{ object = {place}, type = "{kind}" }}' if kind else place
    return channels


def _entries(device: DeviceDescription, direction: Direction) -> Iterator[tuple[Entry, str]]:
    """Yield the mapped numbers with the names of their PDOs.

    Only the first entry of an object that is mapped several times is used.
    """
    seen = set()
    for assignment in device.assignments(direction):
        for pdo in assignment.pdos:
            for entry in pdo.entries:
                place = (entry.index, entry.subindex)
                if entry.index and 1 <= entry.bit_length <= 64 and place not in seen:
                    seen.add(place)
                    yield entry, pdo.name


def _type_name(entry: Entry) -> str:
    """Return the type of an entry, or an unsigned integer if its type is not usable.

    The result is empty for BOOL and for lengths without a type: the PDO of the device states them.
    """
    try:
        kind = by_index(entry.data_type)
        if kind.bit_length == entry.bit_length:
            return "" if kind is BOOL else kind.name
    except ValueError:
        pass
    bits = entry.bit_length
    return UNSIGNED.get(bits, f"BIT{bits}" if 1 < bits < 8 else "")


def _names(devices: Sequence[DeviceDescription]) -> list[str]:
    return unique_names([slug(device.order or device.name, "device") for device in devices])


def unique_names(names: Sequence[str]) -> list[str]:
    """Return the names, with numbers from 1 for those that occur more than once."""
    repeated, given = _repeated(names), set(names)
    used: dict[str, int] = {}
    made: dict[str, None] = {}  # in their order
    for name in names:
        unique = name
        while name in repeated and (unique == name or unique in made or unique in given):
            used[name] = used.get(name, 0) + 1
            unique = f"{name}_{used[name]}"
        made[unique] = None
    return list(made)


def _repeated(values: Sequence[object]) -> set[object]:
    return {value for value, count in Counter(values).items() if count > 1}


def slug(text: str, default: str) -> str:
    """Return a text as a TOML bare key: lower case, with "_" for other characters."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_") or default


def quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def comment_text(text: str) -> str:
    """Return a text of a device without characters that would end a comment."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
