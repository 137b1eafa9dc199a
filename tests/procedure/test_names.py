"""Names of process data from the object dictionary if the SII lacks them."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.virtual import AnalogInputs, MailboxQuirks, Segment, Servo, SiiQuirks
from catenary.virtual.devices.applied import AppliedDevice

MAPPED = (0x6041, 0x6061, 0x606C, 0x6064, 0x6077)


def names(device: AppliedDevice) -> tuple[str, ...]:
    with cat.MainDevice(Segment([device])) as main:
        return cat.Inputs(main.scan()[0]).names


def scan_time(device: AppliedDevice) -> float:
    """Return the virtual time of a scan [s]."""
    segment = Segment([device])
    with cat.MainDevice(segment) as main:
        assert main.scan()[0].error is None
        return segment.now_ns * 1e-9


@pytest.mark.parametrize("pdos", ["unnamed", "absent"])
@pytest.mark.parametrize("kind", [AnalogInputs, Servo])
def test_names_in_the_dictionary_match_the_sii(
    kind: type[AnalogInputs] | type[Servo], pdos: str
) -> None:
    named = names(kind())
    assert names(kind(sii_quirks=SiiQuirks(pdos=pdos))) == named  # type: ignore[arg-type]
    assert len(set(named)) == len(named) > 4


def test_an_entry_may_be_described_without_its_object() -> None:
    quirks = MailboxQuirks(malformed_descriptions=(0x6064,), missing_descriptions=(0x6077,))
    found = names(Servo(sii_quirks=SiiQuirks(pdos="unnamed"), mailbox_quirks=quirks))
    assert found == names(Servo())


def test_a_device_without_descriptions_delays_a_scan_by_seconds() -> None:
    silent = MailboxQuirks(missing_descriptions=(*MAPPED, 0x1600, 0x1A00))
    device = Servo(sii_quirks=SiiQuirks(pdos="unnamed"), mailbox_quirks=silent)
    assert scan_time(device) < scan_time(Servo()) + 15


def test_names_in_the_sii_are_not_requested() -> None:
    malformed = MailboxQuirks(malformed_descriptions=(*MAPPED, 0x1600, 0x1A00))
    assert names(Servo(mailbox_quirks=malformed)) == names(Servo())


def test_types_in_the_dictionary_match_the_sii() -> None:
    """Without types, a negative position would be read as a large positive one."""

    def types(device: AppliedDevice) -> list[int]:
        with cat.MainDevice(Segment([device])) as main:
            [assignment] = main.scan()[0].description.inputs
            return [entry.data_type for pdo in assignment.pdos for entry in pdo.entries]

    assert types(Servo(sii_quirks=SiiQuirks(pdos="absent"))) == types(Servo())
    assert all(types(Servo()))
