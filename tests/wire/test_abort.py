"""SDO abort codes."""

from __future__ import annotations

from catenary.wire.abort import ABORT_CODES, abort_code


def test_codes_have_text():
    assert abort_code(0x06020000).text == "The object does not exist in the object dictionary"
    assert all(entry.text and entry.code == code for code, entry in ABORT_CODES.items())
    assert len(ABORT_CODES) == 31


def test_unknown_codes_have_a_generic_text():
    assert abort_code(0x12345678).text == "Unknown abort code"
    assert abort_code(0x12345678).code == 0x12345678
