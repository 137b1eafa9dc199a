"""Start-up lists as text: for a machine file, and as Python code."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.capture.start_up_list import MappedEntry, StartUpEntry, StartUpList

# Objects that Catenary writes for drives and clocks: mode, interpolation time, synchronisation
_OWN = (0x6060, 0x60C2, 0x1C32, 0x1C33)
_TYPES = {1: "USINT", 2: "UINT", 4: "UDINT", 8: "ULINT"}  # by length [bytes]


def machine_text(found: StartUpList, source: str) -> str:
    """Return the list as TOML for the table [[device]] of a machine file.

    Args:
        found: The list.
        source: Name of the capture.
    """
    return "\n".join((*_head(found, source), "start_up = [", *_toml(found), "]")) + "\n"


def python_text(found: StartUpList, source: str) -> str:
    """Return the list as Python code with `cat.StartUp`.

    Args:
        found: The list.
        source: Name of the capture.
    """
    lines = (*_head(found, source), "import catenary as cat", "from catenary import types", "")
    return "\n".join((*lines, "start_up = [", *_python(found), "]")) + "\n"


def _head(found: StartUpList, source: str) -> Iterator[str]:
    yield f"# Written to device {_printable(str(found.device))} in {_printable(source)}."
    if found.pdos:
        yield "# It also wrote the PDO mapping. For [drives.NAME] or [process_data.NAME]:"
        yield f"#   pdos = {_pdo_text(found)}"
        for number, mapped in found.pdos.items():
            if mapped is not None:
                yield f"#   0x{number:04X}: {_mapped_text(mapped)}"
    own = sorted({entry.index for entry in found.entries} & set(_OWN))
    if own:
        names = ", ".join(f"0x{index:04X}" for index in own)
        yield f"# Catenary writes {names} for drives and clocks: remove these lines for them."
    for each in found.omitted:
        yield f"# omitted: {_printable(each)}"


def _pdo_text(found: StartUpList) -> str:
    return f"[{', '.join(f'0x{number:04X}' for number in found.pdos)}]"


def _mapped_text(mapped: tuple[MappedEntry, ...]) -> str:
    return ", ".join(f"0x{e.index:04X}:{e.subindex:02X} ({e.bits} bits)" for e in mapped) or "empty"


def _toml(found: StartUpList) -> Iterator[str]:
    for each in found.entries:
        value = f'"{each.data.hex()}"' if each.value is None else str(each.value)
        options = ", before_mapping = true" if each.before_mapping else ""
        options += "" if each.verify else ", verify = false"
        options += ", complete_access = true" if each.complete_access else ""
        yield (
            f'    {{ object = "0x{each.index:04X}:{each.subindex:02X}", value = {value}, '
            f'type = "{_type(each)}"{options} }},  # {each.step}, packet {each.packet}'
        )


def _python(found: StartUpList) -> Iterator[str]:
    for each in found.entries:
        value = repr(each.data)
        if each.value is not None:
            value = f"{each.value}, type=types.{_type(each)}"
        options = ", before_mapping=True" if each.before_mapping else ""
        options += "" if each.verify else ", verify=False"
        options += ", complete_access=True" if each.complete_access else ""
        yield (
            f"    cat.StartUp(0x{each.index:04X}, {each.subindex}, {value}{options}),"
            f"  # {each.step}, packet {each.packet}"
        )


def _type(entry: StartUpEntry) -> str:
    return "OCTET_STRING" if entry.value is None else _TYPES[len(entry.data)]


def _printable(text: str) -> str:
    """Return a text of a device without characters that would end a comment."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
