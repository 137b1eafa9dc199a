"""The interface of every release, as measured from its own header: tests/igh/abi.json was made by

    tools/igh_abi.py 1.5.2=include/ecrt.h ...

on x86-64 with gcc 12, from the tags 1.5.2, 1.5.3, 1.6-alpha, 1.6.0 and 1.6.1 of
gitlab.com/etherlab.org/ethercat (mirror github.com/renesas-rz/EtherCAT-Master) and from the 1.6.4
of github.com/yiiverse/IgH-EtherCAT-Master.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import re
import subprocess
from pathlib import Path
from types import ModuleType

import pytest

from catenary.errors import CatenaryError, LinkError
from catenary.igh import abi
from catenary.igh.library import Library
from tests.igh.double import DEFINES, HERE, OLD, Double, build

TABLE = json.loads((HERE / "abi.json").read_text())
STRUCTURES = {
    "ec_master_state_t": abi.MasterState,
    "ec_master_link_state_t": abi.MasterState,
    "ec_slave_config_state_t": abi.ConfigState,
    "ec_master_info_t": abi.MasterInfo,
    "ec_slave_port_link_t": abi.PortLink,
    "ec_slave_info_t": abi.SlaveInfo,
    "ec_domain_state_t": abi.DomainState,
    "ec_pdo_entry_info_t": abi.PdoEntryInfo,
    "ec_pdo_info_t": abi.PdoInfo,
    "ec_sync_info_t": abi.SyncInfo,
}
releases = pytest.mark.parametrize("tag", TABLE)


def place(structure: type[ctypes.Structure], member: str) -> int:
    """Return the offset of a member (`ports[1].desc`) or of a bit field (`x:bit`, `x:bits`)."""
    if ":" in member:
        name, what = member.split(":")
        field = getattr(structure, name)
        first, count = field.size & 0xFFFF, field.size >> 16
        return count if what == "bits" else 8 * field.offset + first
    nested = re.fullmatch(r"ports\[1\]\.(\w+)", member)
    if nested:
        inside = getattr(abi.Port, nested[1]).offset
        return structure.ports.offset + ctypes.sizeof(abi.Port) + inside
    return getattr(structure, member).offset


@releases
def test_structures_have_the_layout_of_the_header(tag: str) -> None:
    for name, structure in STRUCTURES.items():
        members = dict(TABLE[tag]["structures"][name])
        assert ctypes.sizeof(structure) == members.pop("size"), name
        assert {m: place(structure, m) for m in members} == members, name


@releases
def test_calls_have_the_types_of_the_header(tag: str) -> None:
    theirs = TABLE[tag]["functions"]
    returns = abi.RETURNS_SINCE in theirs
    for name, ours in abi.CALLS.items():
        if name not in theirs:
            assert name in abi.NOT_IN_ALL
            continue
        result, *arguments = ours.split()
        result = ("s32" if returns else "v") if result == "r" else result
        assert [result, *arguments] == theirs[name].split(), name


@releases
def test_constants(tag: str) -> None:
    numbers = TABLE[tag]["constants"]
    assert numbers["ECRT_VERSION_MAGIC"] in abi.MAGICS
    assert (numbers["EC_DIR_OUTPUT"], numbers["EC_DIR_INPUT"]) == (1, 2)
    assert numbers["EC_WD_ENABLE"] == abi.WATCHDOG_ENABLE
    assert numbers["EC_WD_DISABLE"] == abi.WATCHDOG_DISABLE
    assert numbers["EC_WC_COMPLETE"] == abi.COUNTER_COMPLETE
    assert numbers["EC_REQUEST_SUCCESS"] == abi.REQUEST_SUCCESS
    assert numbers["EC_REQUEST_ERROR"] == abi.REQUEST_ERROR
    assert numbers["EC_MAX_SYNC_MANAGERS"] == abi.SYNC_MANAGERS_MAX


def the_tool() -> ModuleType:
    path = HERE.parent.parent / "tools" / "igh_abi.py"
    spec = importlib.util.spec_from_file_location("igh_abi", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("tag", DEFINES)
def test_the_double_has_the_same_interface(tag: str, tmp_path: Path) -> None:
    tool = the_tool()
    header = tmp_path / "ecrt.h"
    numbers = dict(each[2:].partition("=")[::2] for each in DEFINES[tag])
    header.write_text(
        "".join(f"#define {name} {value}\n" for name, value in numbers.items())
        + (HERE / "double.h").read_text()
    )
    tool.CODES["status"] = "v" if tag in OLD else "s32"
    theirs = TABLE[tag]
    assert tool.measured(header)["structures"] == {
        name: members
        for name, members in theirs["structures"].items()
        if name != "ec_master_scan_progress_t"
    }
    ours = tool.prototypes(header)
    assert set(ours) >= set(abi.CALLS) & set(theirs["functions"])
    assert ours == {name: theirs["functions"][name] for name in ours}


@pytest.mark.parametrize("tag", DEFINES)
def test_return_values_of_old_libraries_are_not_read(doubles: dict[str, Path], tag: str) -> None:
    """The void functions of the old doubles leave -EIO in place of a result."""
    Double(doubles[tag])
    library = Library(doubles[tag])
    assert library.returns is (tag not in OLD)
    master = library.ecrt_request_master(0)
    domain = library.ecrt_master_create_domain(master)
    assert library.ask("ecrt_domain_queue", domain, what="queue") == 0
    assert library.ask("ecrt_master_send", master, what="send") == 0
    library.ecrt_release_master(master)


def test_errors_of_new_libraries_are_reported(doubles: dict[str, Path]) -> None:
    double = Double(doubles["1.6.1"])
    library = Library(doubles["1.6.1"])
    master = library.ecrt_request_master(0)
    double.fail(b"send", -19)
    with pytest.raises(CatenaryError, match=r"sending: ecrt_master_send returned -19 \(No"):
        library.ask("ecrt_master_send", master, what="sending")
    library.ecrt_release_master(master)


def test_the_calls_of_each_release(doubles: dict[str, Path]) -> None:
    assert not Library(doubles["1.5.2"]).has("ecrt_master_sync_reference_clock_to")
    assert Library(doubles["1.5.3"]).has("ecrt_master_sync_reference_clock_to")
    assert Library(doubles["1.6.1"]).version == "1.6"


def test_a_missing_library_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.igh.library.PLACES", ("/nowhere/libethercat.so.1",))
    monkeypatch.setattr("ctypes.util.find_library", lambda name: None)
    monkeypatch.delenv("CATENARY_LIBETHERCAT", raising=False)
    no_library = r"no libethercat on this machine(.|\n)*docs/how_to/igh\.md"
    with pytest.raises(LinkError, match=no_library):
        Library()
    with pytest.raises(LinkError, match=r"cannot be loaded(.|\n)*check the path"):
        Library(tmp_path / "libethercat.so.1")


def test_another_library_or_version_is_refused(tmp_path: Path) -> None:
    empty = tmp_path / "empty.so"
    subprocess.run(["gcc", "-shared", "-xc", "/dev/null", "-o", empty], check=True)
    with pytest.raises(LinkError, match="is not libethercat"):
        Library(empty)
    other = build(tmp_path, "1.6.1", "-UVERSION_MAGIC", "-DVERSION_MAGIC=0x201")
    with pytest.raises(LinkError, match=r"libethercat 2\.1 \(version magic 0x0201\)"):
        Library(other)
