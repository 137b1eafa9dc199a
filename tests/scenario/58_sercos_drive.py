"""A SERCOS drive moves by its telegrams while its neighbours misbehave over SoE.
One has a procedure command that never ends, one a list that lies about its length, one floods.
Each request ends in time with a specific error; the moving drive loses no cycle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.bus.event_types import SoeNotification
from catenary.errors import MailboxError, ResponseTimeout, SoeError
from catenary.virtual import Coupler, Segment, SercosDrive, SoeQuirks

MOVING, STUCK, LYING = 1, 2, 3
ON, RUN = 0x8000, 0xE000
OPERATING = 3
TURN = 1 << 20
SPEED = 2 * math.pi  # [rad/s]


class Cell:
    """Line of a moving drive, and two drives that misbehave."""

    def __init__(self) -> None:
        self.drive = SercosDrive(name="moving")
        self.stuck = SercosDrive(
            name="stuck", serial=1, soe_quirks=SoeQuirks(stuck_commands=("S-0-0264",))
        )
        self.lying = SercosDrive(
            name="lying",
            serial=2,
            soe_quirks=SoeQuirks(lying_lists=("P-0-0018", "S-0-0017"), fragment_bytes=3),
        )
        self.main = cat.MainDevice(Segment([Coupler(), self.drive, self.stuck, self.lying]))

    def loop(self) -> Iterator[float]:
        """Move the first drive at constant speed. Yield the time since it operates."""
        raws = [cat.ProcessData(self.main.subs[k]) for k in (MOVING, STUCK, LYING)]
        moving = raws[0]
        since: float | None = None
        with cat.Loop(*raws, period=1e-3) as loop:
            for cycle in loop:
                state = int(moving["S-0-0135"]) >> 14
                if state < OPERATING:
                    assert since is None, "the drive left its operation"
                    moving["S-0-0134"] = RUN if state == OPERATING - 1 else ON
                    moving["S-0-0047"] = moving["S-0-0051"]
                    continue
                since = cycle.time if since is None else since
                elapsed = cycle.time - since
                moving["S-0-0047"] = round(elapsed * SPEED / (2 * math.pi) * TURN)
                if elapsed > 0.2:  # accelerated
                    assert self.drive.velocity_rad_s == pytest.approx(SPEED, rel=0.02)
                yield elapsed
            assert loop.timing.counters["lost"] == 0


@pytest.fixture
def cell() -> Iterator[Cell]:
    made = Cell()
    with made.main:
        made.main.scan()
        yield made


def test_a_stuck_command_ends_by_its_deadline(cell: Cell) -> None:
    soe = cell.main.subs[STUCK].soe
    command = None
    for elapsed in cell.loop():
        if elapsed > 0.3 and command is None:
            command = soe.request_command("S-0-0264", timeout=0.5)
        if command is not None and command.done:
            break
        assert elapsed < 2.0
    assert command is not None
    with pytest.raises(ResponseTimeout, match="has not ended after"):
        command.result()
    assert cell.stuck.idn_value("S-0-0264") == bytes(2)  # cancelled
    assert cell.drive.position_rad > SPEED * 0.7


def test_a_lying_list_is_refused(cell: Cell) -> None:
    soe = cell.main.subs[LYING].soe
    requests = None
    for elapsed in cell.loop():
        if elapsed > 0.3 and requests is None:
            requests = soe.request("P-0-0018"), soe.request("S-0-0017"), soe.request("S-0-0002")
        if requests is not None and all(each.done for each in requests):
            break
        assert elapsed < 10.0
    assert requests is not None
    for lying in requests[:2]:
        with pytest.raises(MailboxError, match="its header states"):
            lying.result()
    assert requests[2].result() == 1000


def test_refusals_and_commands_of_the_moving_drive(cell: Cell) -> None:
    sub = cell.main.subs[MOVING]
    requests = None
    for elapsed in cell.loop():
        if elapsed > 0.3 and requests is None:
            requests = (
                sub.soe.request_write("S-0-0047", 0),  # would be a jump
                sub.soe.request_write("S-0-0032", 2),
                sub.soe.request_write("S-0-0024", ["S-0-0036"]),
                sub.soe.request_command("S-0-0264"),
            )
        if requests is not None and all(each.done for each in requests) and elapsed > 0.6:
            break
        assert elapsed < 5.0
    assert requests is not None
    for request, code in zip(requests, (0x700A, 0x7005, 0x7005), strict=False):
        with pytest.raises(SoeError) as error:
            request.result()
        assert error.value.code == code
    requests[3].result()
    found = [each for each in cell.main.events if isinstance(each, SoeNotification)]
    assert [(each.sub, each.idn) for each in found] == [(sub, 264)]


def test_a_flood_of_notifications_does_not_affect_the_drive(cell: Cell) -> None:
    sub = cell.main.subs[STUCK]
    mailbox = cell.stuck.application.mailbox
    answer = None
    for elapsed in cell.loop():
        if elapsed > 0.3:
            mailbox.send(5, bytes.fromhex("050163000300"))
            answer = sub.soe.request("S-0-0002") if answer is None else answer
        if answer is not None and answer.done and elapsed > 0.8:
            break
        assert elapsed < 8.0
    assert answer is not None
    assert answer.result() == 1000
    assert sum(isinstance(each, SoeNotification) for each in cell.main.events) > 50
