"""While a drive moves, its Ethernet port floods this machine, sends fragments that are wrong, and
this machine floods the port. The drive does not notice: no cycle is lost, its objects are read in
time, and dropped frames are reported once per second.
"""

import pytest

import catenary as cat
from catenary.bus import EthernetCounts
from catenary.bus.event_types import EthernetDropped
from catenary.types import UDINT
from catenary.virtual import Coupler, Ethernet, Segment, Servo
from tests.ethernet_wire import Wire
from tests.virtual.ethernet_frames import ping

OBJECTS = 20


def moved(
    wire: Wire, options: Ethernet, flood: int = 0
) -> tuple[EthernetCounts, list[cat.bus.event_types.Event]]:
    """Move the servo while frames pass. Return their counts, and the events."""
    servo = Servo(mailbox_bytes=256, protocols=[options])
    with cat.MainDevice(Segment([Coupler(), servo])) as main:
        sub = main.scan()[1]
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm, period=1e-3) as loop, sub.eoe.connect("cat0") as bridge:
            move = arm.move_by(5.0)
            for number in range(flood):
                wire.to_devices.put(ping(number, 1400))
            for _ in range(OBJECTS):
                asked = sub.sdo.request(0x1018, 1, type=UDINT)
                for _ in loop:
                    if asked.done:
                        break
                assert asked.result() == 0x43544E59
            loop.wait(move)
            assert loop.timing.counters["lost"] == 0
            assert loop.timing.counters["underrun"] == 0
            assert servo.drive_state() == "OPERATION ENABLED"
            counts = bridge.counts[1]
        return counts, [event for event in main.events if isinstance(event, EthernetDropped)]


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    found = Wire()
    monkeypatch.setattr("catenary.bus.segment_eoe.Tap", lambda name: found)
    return found


def test_a_flood_of_the_device(wire: Wire) -> None:
    counts, _ = moved(wire, Ethernet(flood=5000.0))
    assert counts.frames_from_device > 50


@pytest.mark.parametrize("fault", ["lost", "longer", "endless"])
def test_a_flood_of_wrong_fragments(wire: Wire, fault: str) -> None:
    options = Ethernet(flood=2000.0, fragments=fault, time_stamps=True)  # type: ignore[arg-type]
    counts, reports = moved(wire, options)
    if fault == "lost":  # each frame is a single fragment: nothing arrives
        assert counts.frames_from_device == 0
        return
    assert counts.dropped.total() > 10
    assert sum(event.count for event in reports) <= counts.dropped.total()


def test_a_flood_of_this_machine(wire: Wire) -> None:
    counts, _ = moved(wire, Ethernet(), flood=2000)
    assert counts.dropped["queue full"] > 0
    assert counts.frames_from_device > 0
