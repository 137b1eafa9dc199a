"""The description of a device on a kernel master."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

from catenary.igh.describe import describe
from catenary.igh.reservation import Reservation


def test_control_characters_are_removed_from_a_name() -> None:
    port = SimpleNamespace(link=SimpleNamespace(link_up=True), receive_time=0)
    info = SimpleNamespace(
        name=b"\x1b[2Jdrive\r\n",
        sync_count=0,
        vendor_id=1,
        product_code=2,
        revision_number=3,
        serial_number=4,
        alias=0,
        ports=[port] * 4,
    )
    master = cast(Reservation, SimpleNamespace(slave=lambda position: info))
    assert describe(master, 0).name == "[2Jdrive"
