"""The owner's side of a share."""

from __future__ import annotations

import numpy as np
import pytest

import catenary as cat
from catenary.plan.sink import SinkField, SinkLayout
from catenary.virtual import Coupler, Segment, Servo


class Untouched:
    """A ring before its first row: the bytes of the row are arbitrary."""

    def __init__(self, size: int) -> None:
        self._size = size

    def copy(self) -> tuple[int, bytes]:
        return 0, b"\x3f" * self._size


def test_no_position_is_commanded_before_the_first_cycle(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with cat.MainDevice(Segment([Coupler(), Servo()])) as main, cat.Share(name) as share:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3, sink=share):
            assert np.isfinite(share._commanded_position()).all()
            monkeypatch.setattr(share, "_cycles", Untouched(share._dtype.itemsize))
            assert np.isnan(share._commanded_position()).all()
            monkeypatch.undo()


def test_rows_can_be_appended_without_a_loop(name: str) -> None:
    fields = (SinkField("number", "record", 0, "<u8"),)
    layout = SinkLayout(1.0, (), fields, 8, 0, 0, 0, False)
    with cat.Share(name) as share:
        with pytest.raises(RuntimeError, match="is not open"):
            share.append(bytes(8))
        share.open(layout)
        share.append((7).to_bytes(8, "little"))
        with cat.attach(name) as reader:
            assert reader.read()["number"] == 7
        with pytest.raises(ValueError, match="do not fit"):
            share.append(bytes(9))
        share.close()
