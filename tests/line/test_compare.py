"""Comparison of two clones in memory: each test changes one fact."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings

from catenary.line import (
    ClonedAssignment,
    ClonedDevice,
    ClonedEntry,
    ClonedObject,
    ClonedPdo,
    Line,
    MappedEntry,
)
from catenary.line.change import Change, Part, Severity
from catenary.line.compare import compare_lines
from catenary.line.values import SERIAL_WITHHELD
from catenary.model.device import Identity
from catenary.types import DINT, UDINT, UINT, VISIBLE_STRING
from catenary.wire import register
from catenary.wire.dl import DlStatus, Port
from catenary.wire.error_counters import ErrorCounters, PortErrors
from catenary.wire.sdo_information import Access
from catenary.wire.sii import Category, Header, MailboxArea, Sii
from catenary.wire.sii_categories import Pdo, PdoEntry, encode_pdos, encode_strings
from tests.line.clones import lines, one_device

READ = Access.READ_PRE_OP | Access.READ_SAFE_OP | Access.READ_OP
WRITE = Access.WRITE_PRE_OP | Access.WRITE_SAFE_OP | Access.WRITE_OP
NONE = PortErrors()


def entry(
    index: int, value: bytes | None, access: Access = READ | WRITE, **more: object
) -> ClonedEntry:
    return replace(ClonedEntry(index, 0, UDINT.index, 32, access, "", value), **more)


def objects(*entries: ClonedEntry, name: str = "Window") -> tuple[ClonedObject, ...]:
    return tuple(ClonedObject(each.index, 7, each.data_type, 0, name, (each,)) for each in entries)


def clone(*devices: ClonedDevice) -> Line:
    return Line(devices or (one_device(),))


def changed(old: ClonedDevice, new: ClonedDevice) -> list[Change]:
    """Return the changes of one device."""
    return list(compare_lines(clone(old), clone(new)).changes)


def only(old: ClonedDevice, new: ClonedDevice) -> Change:
    [change] = changed(old, new)
    return change


def seen(change: Change) -> tuple[str, str, str, str, str]:
    return change.part, change.what, change.old, change.new, change.severity


def with_registers(*values: tuple[register.Register[bytes], bytes]) -> ClonedDevice:
    device = one_device()
    return replace(
        device, registers={**device.registers, **{of.address: data for of, data in values}}
    )


@given(lines())
@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_a_clone_does_not_differ_from_itself(line: Line) -> None:
    found = compare_lines(line, line)
    assert found.changes == ()
    assert (found.different, found.unread) == (False, False)
    assert found.compared == len(line.devices)


@given(lines(), lines())
@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None, max_examples=50)
def test_any_two_clones_can_be_compared(old: Line, new: Line) -> None:
    for change in compare_lines(old, new).changes:
        assert change.old != change.new, change


# -- devices ---------------------------------------------------------------------------------------


def chain(*identities: Identity, parents: Iterable[int | None] | None = None) -> Line:
    devices = [
        one_device(n, identity=each, name="ABCD"[each.product]) for n, each in enumerate(identities)
    ]
    if parents is not None:
        devices = [
            replace(each, parent=parent, parent_port=None if parent is None else 1)
            for each, parent in zip(devices, parents, strict=True)
        ]
    return Line(tuple(devices))


A, B, C, D = (Identity(2, product, 1, 0) for product in range(4))


def test_a_missing_device_is_the_only_change() -> None:
    [change] = compare_lines(chain(A, B, C), chain(A, C)).changes
    assert (change.device.old, change.device.new) == (1, None)
    assert (change.part, change.new) == (Part.DEVICE, "missing")
    assert change.note == "it was behind device 0 (A) port 1"


def test_an_added_device_is_the_only_change() -> None:
    [change] = compare_lines(chain(A, C), chain(A, B, C)).changes
    assert (change.device.old, change.device.new, change.old) == (None, 1, "-")
    assert change.new.startswith("B, vendor 0x00000002 product 0x00000001")


def test_a_device_at_another_place_in_the_order() -> None:
    [change] = compare_lines(chain(A, B, C, D), chain(A, C, D, B)).changes
    assert seen(change) == (
        *("topology", "order"),
        *("position 1, behind device 0 (A) port 1", "position 3, behind device 2 (D) port 1"),
        "effect",
    )


def test_a_branch_moves_with_its_devices() -> None:
    serials = [each._replace(serial=n + 1) for n, each in enumerate((A, B, C, D))]
    old = Line(chain(*serials, parents=(None, 0, 1, 0)).devices)
    new = Line(chain(*(serials[n] for n in (0, 3, 1, 2)), parents=(None, 0, 0, 2)).devices)
    [change] = compare_lines(old, new).changes
    assert (change.part, change.what, change.device.name) == ("topology", "order", "D")


def test_a_cable_at_another_port_is_the_only_change() -> None:
    old = chain(A, B, C)
    moved = replace(old.devices[1], parent_port=3)
    [change] = compare_lines(old, Line((old.devices[0], moved, old.devices[2]))).changes
    assert seen(change) == (
        *("topology", "cable", "behind device 0 (A) port 1", "behind device 0 (A) port 3"),
        "effect",
    )


def test_another_product_is_not_compared_further() -> None:
    new = one_device(identity=Identity(9, 9, 9, 9), name="other", sii=b"", objects=())
    change = only(one_device(), new)
    assert (change.part, change.what) == (Part.DEVICE, "exchanged")
    assert change.new.startswith("other, vendor 0x00000009")


def test_another_revision_and_serial_number() -> None:
    found = changed(one_device(), one_device(identity=Identity(2, 3, 0x10, 6)))
    assert [seen(each) for each in found] == [
        ("revision", "", "0x00000004", "0x00000010", "effect"),
        ("serial", "", "5", "6", "effect"),
    ]


def test_an_open_port_without_a_device() -> None:
    def status(*ports: Port) -> bytes:
        four = (*ports, *(Port(),) * 4)[:4]
        return DlStatus(True, True, ports=(four[0], four[1], four[2], four[3])).word.to_bytes(
            2, "little"
        )

    on = Port(link=True, loop_closed=False, communication=True)
    old = replace(one_device(), registers={register.DL_STATUS.address: status(on)})
    new = replace(one_device(), registers={register.DL_STATUS.address: status(on, Port(), on)})
    assert seen(only(old, new)) == ("topology", "port 2", "closed", "open", "effect")
    lost = replace(old, registers={register.DL_STATUS.address: bytes(2)})
    assert ("state", "EEPROM", "loaded", "not loaded", "fault") in [*map(seen, changed(old, lost))]


# -- EEPROM ----------------------------------------------------------------------------------------

STRINGS = Category(10, encode_strings(["drive", "v1"]))
NEW_STRINGS = Category(10, encode_strings(["drive", "v2"]))
RXPDO = Category(51, encode_pdos([Pdo(0x1600, (PdoEntry(0x6040, 0, 16),), 2)]))
IMAGE = Sii(Header(2, 3, 4, 5), (STRINGS, RXPDO, Category(0x0805, b"\1\2\3\4")))


def image(**changes: object) -> ClonedDevice:
    return one_device(sii=replace(IMAGE, **changes).encode(512))


def header(**changes: object) -> ClonedDevice:
    return image(header=replace(IMAGE.header, **changes))


@pytest.mark.parametrize(
    ("new", "expected"),
    [
        (header(station_alias=9), ("alias", "", "0", "9", "effect")),
        (
            header(pdi_control=0x80),
            ("SII", "word 0x0000 PDI control", "00 00", "80 00", "effect"),
        ),
        (
            header(standard_send=MailboxArea(0x1080, 128)),
            ("SII", "word 0x001A send mailbox", "00 00 00 00", "80 10 80 00", "effect"),
        ),
        (header(checksum=0x88A4), ("SII", "word 0x0007 checksum", "30 00", "a4 88", "effect")),
        (
            image(categories=(NEW_STRINGS, *IMAGE.categories[1:])),
            ("SII", "string 2", '"v1"', '"v2"', "info"),
        ),
        (
            image(
                categories=(
                    STRINGS,
                    Category(51, encode_pdos([Pdo(0x1600, (PdoEntry(0x6042, 1, 8),), 3)])),
                    IMAGE.categories[2],
                )
            ),
            (
                *("SII", "RxPDO 0x1600", "SyncManager 2: 0x6040:00 16"),
                *("SyncManager 3: 0x6042:01 8", "effect"),
            ),
        ),
        (
            image(categories=(STRINGS, RXPDO, Category(0x0805, b"\1\2\3\5"))),
            ("SII", "category 0x0805, word 1", "0x0403", "0x0503", "effect"),
        ),
        (
            image(categories=(STRINGS, RXPDO)),
            ("SII", "category 0x0805", "4 bytes", "-", "effect"),
        ),
        (
            image(trailing=b"\xff\xff\1"),
            ("SII", "bytes after the categories", "empty", "ff ff 01", "info"),
        ),
    ],
)
def test_one_fact_of_the_eeprom(new: ClonedDevice, expected: tuple[str, ...]) -> None:
    assert seen(only(image(), new)) == expected


def test_the_identity_in_the_eeprom_is_one_change() -> None:
    new = replace(header(revision=7), identity=Identity(2, 3, 7, 5))
    assert only(image(), new).part is Part.REVISION


def test_a_damaged_eeprom_is_compared_as_bytes() -> None:
    broken = one_device(sii=image().sii[:140])
    assert all(each.part is Part.SII for each in changed(image(), broken))
    assert changed(image(), broken)


# -- registers -------------------------------------------------------------------------------------


def counters(*ports: PortErrors, **more: int) -> ClonedDevice:
    four = (*ports, *(NONE,) * 4)[:4]
    data = ErrorCounters((four[0], four[1], four[2], four[3]), **more).encode()
    return with_registers((register.ERROR_COUNTERS, data))


def test_grown_error_counters_name_the_port_and_the_number() -> None:
    old, new = counters(NONE, PortErrors(3, 1)), counters(NONE, PortErrors(40, 1), pdi=2)
    port, pdi = changed(old, new)
    assert seen(port) == ("error counters", "port 1 broken frames", "3", "40", "fault")
    assert port.note == "37 more"
    assert seen(pdi) == ("error counters", "PDI", "0", "2", "fault")


def test_a_full_counter_says_so() -> None:
    change = only(counters(), counters(PortErrors(lost_links=255)))
    assert (change.what, change.note) == ("port 0 lost links", "255 more; the counter is full")


def test_restarted_counters_are_no_fault() -> None:
    change = only(counters(PortErrors(3)), counters(PortErrors(1)))
    assert (change.severity, change.what) == (Severity.INFO, "")
    assert change.note.startswith("the counters restarted")
    assert "port 0: 1 invalid frames" in change.new


def test_errors_after_a_restart_are_a_fault() -> None:
    restart, grown = changed(counters(PortErrors(3)), counters(NONE, PortErrors(200)))
    assert restart.severity is Severity.INFO
    assert seen(grown) == ("error counters", "port 1 broken frames", "0", "200", "fault")
    assert grown.note == "200 since then"


def test_the_counters_of_an_exchanged_device_are_not_compared() -> None:
    new = replace(counters(PortErrors(3)), identity=Identity(2, 3, 4, 6))
    assert only(counters(), new).part is Part.SERIAL


def test_registers_of_the_eeprom_are_always_compared() -> None:
    old = with_registers((register.ESC_CONFIGURATION, b"\x00"))
    new = replace(with_registers((register.ESC_CONFIGURATION, b"\x04")), al_status=1)
    state, configuration = changed(old, new)
    assert seen(state) == ("state", "", "PRE-OP", "INIT", "info")
    assert seen(configuration) == (
        *("register", "ESC configuration (0x0141)", "00", "04", "effect"),
    )


@pytest.mark.parametrize(
    ("state", "severity"), [(1, "variable"), (2, "info"), (4, "effect"), (8, "effect")]
)
def test_registers_of_a_start_up_depend_on_the_state(state: int, severity: str) -> None:
    old = with_registers((register.SYNC_CYCLE_TIMES, bytes(8)))
    new = with_registers((register.SYNC_CYCLE_TIMES, b"\1" + bytes(7)))
    change = only(replace(old, al_status=state), replace(new, al_status=state))
    assert (change.part, change.severity) == ("clock", severity)
    [change] = changed(replace(old, al_status=3), replace(new, al_status=state))
    assert change.part == "state"


def test_an_error_of_the_device_is_a_fault() -> None:
    change = only(one_device(), one_device(al_status=0x12, al_status_code=0x001E))
    assert change.new.startswith("PRE-OP with error 0x001E (")
    assert (change.part, change.severity) == ("state", "fault")
    assert change.note


def test_times_and_the_repeat_bits_of_a_mailbox_are_not_compared() -> None:
    old = with_registers((register.RECEIVE_TIMES, bytes(16)), (register.sync_manager(1), bytes(8)))
    new = with_registers(
        (register.RECEIVE_TIMES, b"\7" * 16),
        (register.sync_manager(1), b"\0\0\0\0\0\0\2\2"),
    )
    assert changed(old, new) == []


# -- mapping and objects ---------------------------------------------------------------------------


def assigned(*pdos: ClonedPdo, values: tuple[ClonedObject, ...] = ()) -> ClonedDevice:
    return one_device(
        assignments=(ClonedAssignment(2, pdos),), objects=values or objects(entry(0x2000, bytes(4)))
    )


def mapping(index: int, *numbers: int) -> ClonedObject:
    count = ClonedEntry(index, 0, 5, 8, READ, "", bytes((len(numbers),)))
    rest = (
        ClonedEntry(index, n, UDINT.index, 32, READ | WRITE, "", number.to_bytes(4, "little"))
        for n, number in enumerate(numbers, start=1)
    )
    return ClonedObject(index, 9, 0x21, len(numbers), "mapping", (count, *rest))


def test_another_assignment() -> None:
    one, two = ClonedPdo(0x1600, ()), ClonedPdo(0x1601, ())
    change = only(assigned(one), assigned(one, two))
    assert seen(change) == ("assignment", "SyncManager 2", "0x1600", "0x1600, 0x1601", "effect")


@pytest.mark.parametrize(("index", "severity"), [(0x1600, "effect"), (0x1601, "info")])
def test_another_mapping_matters_if_it_is_assigned(index: int, severity: str) -> None:
    pdo = ClonedPdo(0x1600, ())
    old = assigned(pdo, values=(mapping(index, 0x6040_0010),))
    new = assigned(pdo, values=(mapping(index, 0x6040_0010, 0x607A_0020),))
    assert seen(only(old, new)) == (
        *("mapping", f"0x{index:04X}", "0x6040:00 16", "0x6040:00 16, 0x607A:00 32", severity),
    )


@pytest.mark.parametrize(
    ("index", "access", "severity"),
    [
        (0x2000, READ | WRITE, "effect"),
        (0x2000, READ | Access.WRITE_OP, "info"),  # a start-up cannot write it
        (0x2000, READ, "variable"),
        (0x2000, Access(0), "info"),  # not described
        (0x6040, READ | WRITE, "variable"),  # mapped
        (0x10F8, READ | WRITE, "variable"),  # time stamp
        (0x100A, READ, "effect"),  # version of the software
        (0x1008, READ, "info"),
    ],
)
def test_the_effect_of_a_value(index: int, access: Access, severity: str) -> None:
    pdo = ClonedPdo(0x1600, (MappedEntry(0x6040, 0, 16),))
    old, new = (
        assigned(pdo, values=objects(entry(index, value, access)))
        for value in (b"\x88\x13\0\0", b"\x64\0\0\0")
    )
    change = only(old, new)
    assert (change.old, change.new, change.severity) == ("5000", "100", severity)
    assert change.what == f"0x{index:04X}:00 Window"
    assert change.entry is not None
    assert change.entry.old == b"\x88\x13\0\0"


@pytest.mark.parametrize(
    ("data_type", "old", "new", "texts"),
    [
        (DINT.index, b"\xff\xff\xff\xff", b"\1\0\0\0", ("-1", "1")),
        (UINT.index, b"\1\0", b"\2", ("1", "02")),  # the second one does not fit its type
        (VISIBLE_STRING.index, b"v1", b"v2", ('"v1"', '"v2"')),
        (VISIBLE_STRING.index, b"v1", b"v1\0", ("76 31", "76 31 00")),  # equal text
        (0x0801, b"\1", b"", ("01", "empty")),
    ],
)
def test_values_are_decoded_by_their_type(
    data_type: int, old: bytes, new: bytes, texts: tuple[str, str]
) -> None:
    before, now = (
        assigned(values=objects(entry(0x2000, value, data_type=data_type))) for value in (old, new)
    )
    change = only(before, now)
    assert (change.old, change.new) == texts


def test_long_bytes_are_shown_from_their_first_difference_on() -> None:
    before, now = (
        assigned(values=objects(entry(0x2000, bytes(100) + end, data_type=0x000A)))
        for end in (b"\1", b"\2")
    )
    change = only(before, now)
    assert (change.old, change.new) == ("01 at byte 100 of 101", "02 at byte 100 of 101")


def test_objects_that_only_one_device_has() -> None:
    one = objects(entry(0x2000, bytes(4)))
    two = objects(entry(0x2000, bytes(4)), entry(0x2001, bytes(4)))
    change = only(assigned(values=two), assigned(values=one))
    assert seen(change) == ("object", "0x2001 Window", "present", "-", "effect")
    partial = replace(assigned(values=one), missing={"objects": "reading ended"})
    found = compare_lines(clone(assigned(values=two)), clone(partial))
    assert found.changes == ()
    assert found.unread
    assert "objects: reading ended" in str(found.uncompared[0])


def test_another_description() -> None:
    old = assigned(values=objects(entry(0x2000, bytes(4))))
    new = assigned(values=objects(entry(0x2000, bytes(4), READ, data_type=DINT.index)))
    kind, access = changed(old, new)
    assert seen(kind)[1:4] == ("0x2000:00 Window, type", "UDINT, 32 bits", "DINT, 32 bits")
    assert access.new == "read pre op, read safe op, read op"
    named = assigned(values=objects(entry(0x2000, bytes(4)), name="Other"))
    assert seen(only(old, named))[1:] == ("0x2000 name", '"Window"', '"Other"', "info")


def test_a_refused_value() -> None:
    old = assigned(values=objects(entry(0x2000, bytes(4))))
    refused = assigned(values=objects(entry(0x2000, None, abort=0x0602_0000)))
    assert seen(only(old, refused))[2:4] == ("0", "refused with 0x06020000")
    silent = assigned(values=objects(entry(0x2000, None, reason="no answer")))
    found = compare_lines(clone(old), clone(silent))
    assert (found.changes, found.unread) == ((), True)
    assert str(found.uncompared[0]).endswith("1 values: not read: 0x2000:00: no answer")


def test_withheld_serial_numbers_are_not_compared() -> None:
    place = ClonedEntry(0x1018, 4, UDINT.index, 32, READ, "serial", b"\5\0\0\0")
    whole = ClonedObject(0x1018, 9, 0x23, 4, "Identity", (place,))
    withheld = replace(whole, entries=(replace(place, value=None, reason=SERIAL_WITHHELD),))
    old = Line((one_device(objects=(whole,)),))
    new = Line((one_device(objects=(withheld,), identity=Identity(2, 3, 4, 0)),), serials=False)
    for one, other in ((old, new), (new, old)):
        found = compare_lines(one, other)
        assert (found.changes, found.uncompared) == ((), ())


def test_the_serial_number_of_the_manufacturer_shows_an_exchange() -> None:
    old, new = (
        assigned(values=objects(entry(0xF9F0, serial, READ, data_type=9), name="Serial"))
        for serial in (b"A1", b"A2")
    )
    assert seen(only(old, new)) == ("serial", "0xF9F0:00 Serial", '"A1"', '"A2"', "effect")
