"""Numbers of objects as the slots of the model store them: 64 bits with a sign."""

from __future__ import annotations

import pytest

from catenary.virtual.coe.dictionary import slot_value


@pytest.mark.parametrize(
    ("data", "bits", "signed", "value"),
    [
        ("ff", 8, False, 255),
        ("ff", 8, True, -1),
        ("ff", 1, False, 1),
        ("00 00 80", 24, True, -(1 << 23)),
        ("ff ff ff ff ff ff ff ff", 64, False, -1),  # the bits of a ULINT
        ("00 00 00 00 00 00 00 80", 57, False, 0),  # a default that is too long, in an ESI
        ("ff ff ff ff ff ff ff ff", 57, False, (1 << 57) - 1),
        ("ff ff ff ff ff ff ff ff 01", 300, False, -1),
        ("ff", 0, True, 0),
        ("", 16, True, 0),
    ],
)
def test_a_number_fits_into_a_slot(data: str, bits: int, signed: bool, value: int) -> None:
    found = slot_value(bytes.fromhex(data), bits, signed)
    assert found == value
    assert -(1 << 63) <= found < 1 << 63
