"""Devices of ESIs with absurd numbers: an error of the package, or a device that can be scanned."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

import catenary as cat
from catenary.errors import CatenaryError
from catenary.esi.device import (
    DeviceKey,
    EsiController,
    EsiDevice,
    EsiEeprom,
    EsiEntry,
    EsiMailbox,
    EsiPdo,
    EsiSyncManager,
)
from catenary.esi.dictionary import EsiDictionary, EsiObject, EsiObjectEntry
from catenary.model.device import Direction
from catenary.virtual import Segment, from_esi
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse

WORD, BYTE = st.integers(0, 0xFFFF), st.integers(0, 0xFF)
TYPES = st.sampled_from(["", "BOOL", "UINT", "LREAL", "STRING(4)", "INT24", "unknown"])
MANAGERS = st.lists(
    st.builds(
        EsiSyncManager,
        index=st.just(0),
        use=st.sampled_from(SyncManagerUse),
        start=st.one_of(WORD, st.sampled_from([0, 0x0F00, 0x1000, 0x1100])),
        default_size=st.one_of(st.integers(0, 512), WORD),
        control=st.one_of(BYTE, st.sampled_from([0x20, 0x22, 0x26, 0x64])),
    ),
    max_size=18,
)
ENTRIES = st.lists(
    st.builds(EsiEntry, WORD, BYTE, st.integers(0, 3000), st.text(max_size=5), TYPES), max_size=8
).map(tuple)
PDOS = st.lists(
    st.builds(
        EsiPdo,
        direction=st.sampled_from(Direction),
        index=st.one_of(WORD, st.sampled_from([0x1600, 0x1A00, 0x1C12])),
        name=st.text(max_size=5),
        entries=ENTRIES,
        sync_manager=st.one_of(st.none(), st.integers(0, 20)),
        fixed=st.booleans(),
        mandatory=st.booleans(),
        excludes=st.frozensets(st.sampled_from([0x1600, 0x1A00]), max_size=2),
    ),
    max_size=6,
).map(tuple)
MAILBOXES = st.one_of(
    st.none(),
    st.builds(
        EsiMailbox,
        protocols=st.integers(0, 0x3F).map(MailboxProtocol),
        complete_access=st.booleans(),
        sdo_information=st.booleans(),
        pdo_assign=st.booleans(),
        pdo_configuration=st.booleans(),
    ),
)


@st.composite
def objects(draw: st.DrawFn) -> EsiObject:
    index = draw(WORD)
    entries = draw(
        st.lists(
            st.builds(
                EsiObjectEntry,
                index=st.just(index),
                subindex=BYTE,
                name=st.text(max_size=5),
                type=TYPES,
                bit_length=st.integers(0, 300),
                access=st.sampled_from(["ro", "rw", "wo", "?"]),
                pdo_mapping=st.sampled_from(["", "R", "T", "RT"]),
                default=st.one_of(st.none(), st.binary(max_size=9)),
            ),
            max_size=5,
        )
    )
    return EsiObject(index, "object", "", 0, tuple(entries))


@settings(max_examples=40)
@given(
    MANAGERS,
    PDOS,
    MAILBOXES,
    st.lists(objects(), max_size=5),
    st.binary(max_size=16),
    st.text("YKH ?", max_size=5),
    st.integers(0, 1 << 20),
)
def test_an_absurd_device_is_refused_or_scanned(
    managers: list[EsiSyncManager],
    pdos: tuple[EsiPdo, ...],
    mailbox: EsiMailbox | None,
    found: list[EsiObject],
    configuration: bytes,
    physics: str,
    dpram: int,
) -> None:
    device = EsiDevice(
        DeviceKey(1, 2, 3),
        "Vendor",
        "type",
        "name",
        physics=physics,
        sync_managers=tuple(
            EsiSyncManager(n, m.use, m.start, m.default_size, control=m.control)
            for n, m in enumerate(managers)
        ),
        pdos=pdos,
        mailbox=mailbox,
        dictionary=EsiDictionary(objects={each.index: each for each in found}),
        controller=EsiController(dpram_size=dpram),
        eeprom=EsiEeprom(2048, configuration),
    )
    try:
        model = from_esi(device)
    except CatenaryError:
        return
    with cat.MainDevice(Segment([model])) as main:
        try:
            [sub] = main.scan()
        except CatenaryError:
            return
        assert sub.identity.product == 2


def test_an_object_of_57_bits_may_have_its_highest_byte_set() -> None:
    """Found by `test_an_absurd_device_is_refused_or_scanned`."""
    default = bytes(7) + b"\x80"
    entry = EsiObjectEntry(0x7000, 1, "x", "", 57, "rw", "R", default)
    device = EsiDevice(
        DeviceKey(1, 2, 3),
        "Vendor",
        "type",
        "name",
        sync_managers=(
            EsiSyncManager(0, SyncManagerUse.MAILBOX_OUT, 0x1000, 128, control=0x26),
            EsiSyncManager(1, SyncManagerUse.MAILBOX_IN, 0x1080, 128, control=0x22),
            EsiSyncManager(2, SyncManagerUse.OUTPUTS, 0x1100, 8, control=0x64),
        ),
        pdos=(EsiPdo(Direction.OUTPUT, 0x1600, "Outputs", (EsiEntry(0x7000, 1, 57, "x"),), 2),),
        mailbox=EsiMailbox(MailboxProtocol.COE),
        dictionary=EsiDictionary(objects={0x7000: EsiObject(0x7000, "x", "", 57, (entry,))}),
    )
    with cat.MainDevice(Segment([from_esi(device)])) as main:
        sub = main.scan()[0]
        assert sub.sdo.read(0x7000, 1)[:7] == default[:7]
        sub.sdo.write(0x7000, 1, b"\xff" * 8)
