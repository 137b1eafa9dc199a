"""Texts of error codes of drives."""

import pytest

from catenary.wire.drive_error import error_text


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x8611, "following error"),
        (0x7308, "sensor"),  # text of its group
        (0x2315, "continuous over-current"),
        (0xFF42, "manufacturer specific"),
        (0x8210, "process data too short"),
        (0xA001, "leaving SAFE-OP was not successful"),
        (0xB123, "unknown error"),
        (0x0123, "unknown error"),
        (0x0000, "no error"),
    ],
)
def test_a_code_has_its_own_text_or_that_of_its_group(code: int, text: str) -> None:
    assert error_text(code) == text
