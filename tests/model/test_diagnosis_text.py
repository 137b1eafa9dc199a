"""Texts of diagnosis messages, with placeholders as in printf."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.model.diagnosis_text import TEXT_MAX, formatted, message_text
from catenary.wire.diagnosis_history import DiagnosisMessage, Parameter, ParameterKind

WORD = Parameter(ParameterKind.NUMBER, b"\x26\0", 0x0006)


@pytest.mark.parametrize(
    ("template", "values", "text"),
    [
        # texts of Beckhoff's terminals, as in their list of diagnosis messages
        ("Initialization 0x%X, 0x%X, 0x%X", (1, 0xAB, 3), "Initialization 0x1, 0xAB, 0x3"),
        ("State change request from: %d to: %d", (2, 4), "State change request from: 2 to: 4"),
        ("%s is too hot: %.1f degrees", ("Motor", 90.25), "Motor is too hot: 90.2 degrees"),
        ("%04x|%-4d|%+d|%5s|%c", (0xA, 7, 1, "ab", 65), "000a|7   |+1|   ab|A"),
        ("%ld %hu %lu", (1, 2, 3), "1 2 3"),
        ("%2$d before %1$d", (1, 2), "2 before 1"),
        ("channel %2, value %1", (1, 2), "channel 2, value 1"),
        ("100 %% of %d", (5,), "100 % of 5"),
        ("90 % during %d s", (5,), "90 % during 5 s"),
        ("0x%X", (-2147024891,), "0x80070005"),
        ("%x", (-(2**63),), "8000000000000000"),
        ("%d and %d", (1,), "1 and %d"),
        ("nothing", (1, b"\x01\xff"), "nothing (1, 01 ff)"),
        ("%d", ("text",), "text"),
        ("%x", (1.5,), "1.5"),
        ("%9999999999d", (1,), "1".rjust(64)),
        ("%.9999999999f", (1.0,), f"{1:.64f}"),
    ],
)
def test_placeholders(template: str, values: tuple[object, ...], text: str) -> None:
    assert formatted(template, values) == text  # type: ignore[arg-type]


def test_the_text_of_the_esi_is_used() -> None:
    message = DiagnosisMessage(0xA000_E800, 2, 5, 0, parameters=(WORD,))
    assert message_text(message, {5: "SM%d has wrong settings"}) == "SM38 has wrong settings"


def test_without_a_text_the_numbers_are_shown() -> None:
    error = DiagnosisMessage(0x8611_E800, 2, 5, 0, parameters=(WORD,))
    assert message_text(error, {}) == "error 0x8611 (following error), text 0x0005, parameters 38"
    assert message_text(DiagnosisMessage(0xE002, 0, 0, 0), {}) == "code 0x0000E002, no text"


def test_a_parameter_may_be_a_text() -> None:
    parameter = Parameter(ParameterKind.TEXT_ID, b"\7\0")
    message = DiagnosisMessage(0xE000, 0, 1, 0, parameters=(parameter,))
    assert message_text(message, {1: "%s failed", 7: "Brake"}) == "Brake failed"
    assert message_text(message, {1: "%s failed"}) == "text 0x0007 failed"


values = st.one_of(
    st.integers(-(2**63), 2**64 - 1), st.floats(), st.text(max_size=20), st.binary(max_size=8)
)


@given(st.text(alphabet="%$.0123456789dsxXcfeglh-+# %a", max_size=40), st.lists(values, max_size=4))
def test_any_template_gives_a_bounded_text(template: str, given_: list[object]) -> None:
    assert len(formatted(template, given_)) <= TEXT_MAX  # type: ignore[arg-type]
