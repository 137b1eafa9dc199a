"""Every event fits its row. Overwritten events are counted."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

import catenary as cat
from catenary.errors import ShareError
from catenary.plan.sink import Incident
from catenary.share.events import decode_event, encode_event
from catenary.share.layout import EVENT_COUNT, EVENT_SIZE
from catenary.virtual import Segment, Servo

text = st.text(st.characters(exclude_categories=[]), max_size=3000)  # including surrogates


@given(text, text, st.integers(1, 2**60))
def test_every_event_fits_its_row(message: str, detail: str, number: int) -> None:
    incident = Incident("Emergency", message, 1.5, 3, {"data": detail})
    row = encode_event(incident, 7, number)
    assert len(row) <= EVENT_SIZE
    event = decode_event(row.ljust(EVENT_SIZE, b"\0"))
    assert (event.serial, event.number, event.kind, event.position) == (7, number, "Emergency", 3)
    told, detail = (each.encode(errors="replace").decode() for each in (message, detail))
    assert event.message == told or event.message.endswith(" ...")
    assert event.details in ({"data": detail}, {})


def test_damaged_event_is_refused() -> None:
    with pytest.raises(ShareError, match="damaged"):
        decode_event(b"[]")


def test_oldest_events_are_overwritten(name: str) -> None:
    with cat.MainDevice(Segment([Servo()])) as main, cat.Share(name) as share:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm, sink=share) as loop, cat.attach(name) as reader:
            next(loop)
            for k in range(EVENT_COUNT + 10):
                share.report(Incident("Test", f"number {k}", 0.0))
            events, lost = reader.events()
            assert (len(events), lost) == (EVENT_COUNT, 10)
            assert events[-1].message == f"number {EVENT_COUNT + 9}"
            assert events[0].number == reader.number
            assert "number 10" in str(events[0])
        share.report(Incident("Test", "after the end", 0.0))  # discarded
