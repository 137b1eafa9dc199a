"""SubDevice.latch: times of edges at the latch inputs, before and during a loop."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import catenary as cat
from catenary.bus.latch import _is_later
from catenary.errors import ConfigurationError, DecodeError
from catenary.virtual import Coupler, DigitalInputs, Segment, Servo
from catenary.wire.latch import decode_times


@contextmanager
def scanned(**options: Any) -> Iterator[tuple[Servo, Any]]:
    servo = Servo(**options)
    segment = Segment([Coupler(), servo, DigitalInputs()])
    with cat.MainDevice(segment) as main:
        yield servo, main.scan()


def now(servo: Servo) -> int:
    return servo.core.system_time(servo.position)


@pytest.mark.parametrize("bits", [32, 64])
def test_the_first_edge_is_kept_until_it_is_read(bits: Any) -> None:
    with scanned(clock_bits=bits) as (servo, subs):
        latch = subs[1].latch(0)
        assert latch.active is None
        assert latch.read() == ()
        time = now(servo)
        servo.set_latch_input(0, True)
        servo.set_latch_input(0, False)
        subs[1].read_state()  # time passes
        servo.set_latch_input(0, True)
        [event] = latch.read()
        assert (event.edge, event.time_ns) == ("rising", time)
        assert latch.active
        assert latch.read() == ()  # acknowledged, and the second edge was not kept
        assert latch.events == (event,)


def test_the_last_edge_in_continuous_mode() -> None:
    with scanned() as (servo, subs):
        latch = subs[1].latch(1, edge="both", continuous=True)
        latch.read()
        servo.set_latch_input(1, True)
        subs[1].read_state()
        down = now(servo)
        servo.set_latch_input(1, False)
        subs[1].read_state()
        up = now(servo)
        servo.set_latch_input(1, True)
        assert [(each.edge, each.time_ns) for each in latch.read()] == [
            ("falling", down),
            ("rising", up),
        ]
        assert latch.read() == ()


def test_old_events_are_discarded_at_the_set_up() -> None:
    with scanned() as (servo, subs):
        subs[1].latch(0).read()
        servo.set_latch_input(0, True)
        assert subs[1].latch(0).read() == ()


def test_the_loop_time_of_an_edge() -> None:
    with scanned() as (servo, subs):
        arm = cat.Drives([subs[1]], counts_per_turn=2**20, velocity_limit=1.0, dc=True)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait_locked()
            latch = subs[1].latch(0)
            pending = latch.request()
            edge = None
            for cycle in loop:
                if pending.done:
                    found = pending.result()
                    if found:
                        break
                    pending = latch.request()
                if edge is None and cycle.time > 0.05:
                    edge = cycle
                    begun = cycle.time
                    servo.set_latch_input(0, True)
                assert cycle.time < 1.0
            time = loop.clocks.loop_time(found[0].time_ns, cycle)
            assert time == pytest.approx(begun, abs=1e-3)
            low = found[0].time_ns & 0xFFFF_FFFF
            assert loop.clocks.loop_time(low, cycle, bits=32) == pytest.approx(time, abs=1e-9)


def test_an_input_of_the_application_is_refused() -> None:
    with scanned() as (servo, subs):
        servo.core.poke(servo.position, 0x0980, b"\x20")
        with pytest.raises(ConfigurationError, match=r"controls LATCH1 \(0x0980 = 0x20, bit 5\)"):
            subs[1].latch(1).read()
        subs[1].latch(0).read()


def test_a_device_without_a_clock_is_refused() -> None:
    with scanned() as (_, subs):
        with pytest.raises(ConfigurationError, match="has no distributed clock"):
            subs[2].latch(0)
        with pytest.raises(ValueError, match="must be 0 or 1"):
            subs[1].latch(2)
        with pytest.raises(ValueError, match="'falling' or 'both'"):
            subs[1].latch(0, edge="up")


def test_the_inputs_keep_their_own_events() -> None:
    with scanned() as (servo, subs):
        first, second = subs[1].latch(0), subs[1].latch(1)
        first.read()
        second.read()
        servo.set_latch_input(0, True)
        servo.set_latch_input(1, True)
        time = now(servo)
        assert [each.time_ns for each in first.read()] == [time]
        subs[1].read_state()  # time passes
        servo.set_latch_input(1, False)
        servo.set_latch_input(1, True)  # the first edge is kept: reading LATCH0 does not release it
        assert [each.time_ns for each in second.read()] == [time]


def test_edges_are_in_the_order_of_time_although_32_bits_wrap() -> None:
    assert _is_later(5, 0xFFFF_FFF0, 32)
    assert not _is_later(0xFFFF_FFF0, 5, 32)
    assert _is_later(0xFFFF_FFF0, 5, 64)


def test_the_times_are_decoded() -> None:
    # layout of the ESC data sheet, section II, 0x09B0 to 0x09CF
    data = (1 << 32 | 2).to_bytes(8, "little") + (3 << 32 | 4).to_bytes(8, "little")
    assert decode_times(data, 64) == (1 << 32 | 2, 3 << 32 | 4)
    assert decode_times(data, 32) == (2, 4)
    with pytest.raises(DecodeError, match="need 16 bytes, received 15"):
        decode_times(data[1:], 64)
