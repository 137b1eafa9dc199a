"""DL control and status."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.wire.dl import DlControl, DlStatus, Loop, Port
from tests.wire.strategies import flag, u16


def test_status_of_a_coupler():
    # EK1100 in ethercrab's tests/replay-dc.pcapng, frame 215: cables at ports 0 and 1
    status = DlStatus.from_word(0x5A31)
    connected = Port(link=True, loop_closed=False, communication=True)
    assert status.ports == (connected, connected, Port(), Port())
    assert status.pdi_operational
    assert not status.pdi_watchdog
    assert status.word == 0x5A31


@given(u16)
def test_status_words_round_trip_without_the_reserved_bit(word):
    assert DlStatus.from_word(word).word == word & ~0x0008


@given(
    st.builds(
        DlControl,
        *(flag, flag, st.tuples(*[st.sampled_from(Loop)] * 4), st.integers(0, 7), flag, flag),
    )
)
def test_control_round_trips(control):
    assert DlControl.from_word(control.word) == control


def test_control_bits_match_the_data_sheet():
    assert DlControl().word == 0x0007_0001  # the value after power-on
    closed = DlControl(loops=(Loop.AUTO, Loop.CLOSED, Loop.AUTO, Loop.AUTO), alias_enabled=True)
    assert closed.word == 0x0107_0C01


def test_a_fifo_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="FIFO"):
        _ = DlControl(receive_fifo=8).word
