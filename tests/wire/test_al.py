"""States, AL control and status, status codes."""

from __future__ import annotations

import pytest
from hypothesis import given

from catenary.errors import DecodeError
from catenary.wire.al import STATUS_CODES, AlControl, AlState, AlStatus, states_in, status_code
from tests.wire.strategies import u16


@pytest.mark.parametrize(
    ("word", "status"),
    [
        # ethercrab's tests/replay-dc.pcapng, frames 95 (error pending after power-on) and 1163
        (0x0011, AlStatus(AlState.INIT, error=True)),
        (0x0002, AlStatus(AlState.PRE_OP)),
        (0x0028, AlStatus(AlState.OP, identification=True)),
        (0x0014, AlStatus(AlState.SAFE_OP, error=True)),
    ],
)
def test_status_words(word, status):
    assert AlStatus.from_word(word) == status
    assert status.word == word


@pytest.mark.parametrize(
    ("word", "control"),
    [
        # the same capture, frame 2: an acknowledgement with a request for INIT
        (0x0011, AlControl(AlState.INIT, acknowledge=True)),
        (0x0008, AlControl(AlState.OP)),
        (0x0022, AlControl(AlState.PRE_OP, request_identification=True)),
        (0x0003, AlControl(AlState.BOOT)),
    ],
)
def test_control_words(word, control):
    assert AlControl.from_word(word) == control
    assert control.word == word


@given(u16)
def test_every_word_gives_a_value_or_decode_error(word):
    if word & 0x0F in list(AlState):
        assert AlStatus.from_word(word).word == word & 0x3F
        assert AlControl.from_word(word).word == word & 0x3F
        return
    for decode in (AlStatus.from_word, AlControl.from_word):
        with pytest.raises(DecodeError, match=f"0x{word:04X}"):
            decode(word)


def test_states_of_a_broadcast_read():
    assert states_in(AlState.PRE_OP | AlState.OP) == {AlState.PRE_OP, AlState.OP}
    assert states_in(0x0008) == {AlState.OP}
    assert states_in(0) == set()


def test_state_names_are_those_of_the_standard():
    assert [str(state) for state in AlState] == ["INIT", "PRE-OP", "BOOT", "SAFE-OP", "OP"]


def test_status_codes_have_text_and_cause():
    watchdog = status_code(0x001B)
    assert watchdog.text == "SyncManager watchdog"
    assert "loop" in watchdog.cause
    assert all(entry.text and entry.code == code for code, entry in STATUS_CODES.items())


def test_unknown_status_codes_have_a_generic_text():
    assert status_code(0x9000).text == "Vendor specific AL status code"
    assert status_code(0x7000).text == "Unknown AL status code"
