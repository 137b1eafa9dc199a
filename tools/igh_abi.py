"""The binary interface of libethercat, measured from ecrt.h of a release: sizes, offsets, types.

    tools/igh_abi.py 1.6.1=/path/to/1.6.1/include/ecrt.h 1.5.2=... > tests/igh/abi.json

Structures are measured by a C program compiled against the header; prototypes are read from the
preprocessed header. The output contains only numbers and type codes, and no text of the header.
Codes: v void, p pointer, u8 ... s64 integers, f32, f64, n struct by value (4 bytes, in_addr).
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

BITS = {
    "ec_master_state_t": ("al_states", "link_up"),
    "ec_master_link_state_t": ("al_states", "link_up"),
    "ec_slave_config_state_t": ("online", "operational", "al_state"),
    "ec_master_info_t": ("link_up",),
}
MEMBERS = {
    "ec_master_state_t": ("slaves_responding",),
    "ec_master_link_state_t": ("slaves_responding",),
    "ec_slave_config_state_t": (),
    "ec_master_info_t": ("slave_count", "scan_busy", "app_time"),
    "ec_master_scan_progress_t": ("slave_count", "scan_index"),
    "ec_slave_port_link_t": ("link_up", "loop_closed", "signal_detected"),
    "ec_slave_info_t": (
        *("position", "vendor_id", "product_code", "revision_number", "serial_number"),
        *("alias", "current_on_ebus", "ports", "ports[1].desc", "ports[1].link"),
        *("ports[1].receive_time", "ports[1].next_slave", "ports[1].delay_to_next_dc"),
        *("al_state", "error_flag", "sync_count", "sdo_count", "name"),
    ),
    "ec_domain_state_t": ("working_counter", "wc_state", "redundancy_active"),
    "ec_pdo_entry_info_t": ("index", "subindex", "bit_length"),
    "ec_pdo_info_t": ("index", "n_entries", "entries"),
    "ec_sync_info_t": ("index", "dir", "n_pdos", "pdos", "watchdog_mode"),
    "ec_pdo_entry_reg_t": (
        *("alias", "position", "vendor_id", "product_code", "index", "subindex"),
        *("offset", "bit_position"),
    ),
}
CONSTANTS = (
    *("ECRT_VERSION_MAGIC", "EC_MAX_SYNC_MANAGERS", "EC_MAX_STRING_LENGTH", "EC_MAX_PORTS"),
    *("EC_END", "EC_DIR_OUTPUT", "EC_DIR_INPUT", "EC_WD_DEFAULT", "EC_WD_ENABLE"),
    *("EC_WD_DISABLE", "EC_WC_ZERO", "EC_WC_INCOMPLETE", "EC_WC_COMPLETE"),
    *("EC_REQUEST_UNUSED", "EC_REQUEST_BUSY", "EC_REQUEST_SUCCESS", "EC_REQUEST_ERROR"),
)
CODES = {
    **{f"{s}int{n}_t": f"{'u' if s else 's'}{n}" for s in ("", "u") for n in (8, 16, 32, 64)},
    **{"void": "v", "int": "s32", "unsigned int": "u32", "size_t": "u64", "struct in_addr": "n"},
    **{"float": "f32", "double": "f64"},
    **{f"ec_{name}_t": "u32" for name in ("direction", "watchdog_mode", "al_state")},
    "ec_request_state_t": "u32",
}
PROTOTYPE = re.compile(r"([\w\s*]+?)\b(ecrt_\w+)\s*\(([^;{]*?)\)\s*;")


def code_of(text: str) -> str:
    """Return the type code of a parameter or return type, without its name."""
    words = re.sub(r"\b(const|extern|__attribute__.*)\b", " ", text)
    if "*" in words or "[" in words or "(" in words:
        return "p"
    names = words.split()
    for count in (2, 1):
        if " ".join(names[:count]) in CODES:
            return CODES[" ".join(names[:count])]
    raise SystemExit(f"no type code for {text!r}")


def prototypes(header: Path) -> dict[str, str]:
    """Return the type codes of each function, return type first."""
    text = subprocess.run(
        ["gcc", "-E", "-P", "-x", "c", header], capture_output=True, text=True, check=True
    ).stdout
    text = re.sub(r'__attribute__\s*\(\(.*?"?\)\s*\)\s*\)?', " ", text)
    found = {}
    for kind, name, parameters in PROTOTYPE.findall(text):
        callback = re.sub(r"\(\s*\*\s*\w*\s*\)\s*\([^)]*\)", "*", parameters)
        each = [part for part in callback.split(",") if part.strip() not in ("", "void")]
        found[name] = " ".join([code_of(kind), *map(code_of, each)])
    return found


def measured(header: Path) -> dict[str, object]:
    """Return the structures and constants, as measured by a compiled program."""
    text = header.read_text()
    lines = []
    for name, members in MEMBERS.items():
        if f"}} {name};" not in text:
            continue
        lines.append(f'printf("{name} size %zu\\n", sizeof({name}));')
        for member in members:
            lines.append(f'printf("{name} {member} %zu\\n", offsetof({name}, {member}));')
        for member in BITS.get(name, ()):
            lines.append(
                f"{{ {name} s; memset(&s, 0, sizeof s); s.{member} = ~0; unsigned k, n = 0; "
                f"for (k = 0; k < 8 * sizeof s; k++) if (((char *)&s)[k / 8] >> (k % 8) & 1) "
                f'{{ if (!n++) printf("{name} {member}:bit %u\\n", k); }} '
                f'printf("{name} {member}:bits %u\\n", n); }}'
            )
    lines += [f'printf("- {name} %lld\\n", (long long){name});' for name in CONSTANTS]
    source = (
        f'#include <stddef.h>\n#include <stdio.h>\n#include <string.h>\n#include "{header}"\n'
        f"int main(void) {{ {' '.join(lines)} return 0; }}\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "abi"
        subprocess.run(
            ["gcc", "-w", "-x", "c", "-", "-o", program], input=source, text=True, check=True
        )
        out = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    structures: dict[str, dict[str, int]] = {}
    constants = {}
    for line in out.splitlines():
        owner, name, value = line.split()
        if owner == "-":
            constants[name] = int(value)
        else:
            structures.setdefault(owner, {})[name] = int(value)
    return {"constants": constants, "structures": structures}


def main(arguments: list[str]) -> None:
    table = {}
    for argument in arguments:
        tag, _, path = argument.partition("=")
        header = Path(path).resolve()
        table[tag] = {**measured(header), "functions": prototypes(header)}
    json.dump(table, sys.stdout, indent=1, sort_keys=True)
    print()


if __name__ == "__main__":
    main(sys.argv[1:])
