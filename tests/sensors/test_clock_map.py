from __future__ import annotations

import random

from catenary.sensors.clock_map import ClockMap

MS = 1_000_000
DELAY = 2 * MS  # smallest delay
OFFSET = 77_000 * MS  # of the clock of the device


def test_jitter_of_the_transport_does_not_reach_the_times():
    chance, clock = random.Random(1), ClockMap()
    errors = []
    for k in range(2000):
        true = k * 2 * MS
        received = true + DELAY + int(chance.expovariate(1 / (3 * MS)))
        mapped = clock.map(true - OFFSET, max(received, true))
        if k > 200:
            errors.append(mapped - true - DELAY)
    assert max(map(abs, errors)) < 0.2 * MS


def test_a_drifting_clock_is_followed():
    clock = ClockMap()
    for k in range(5000):
        true = k * 2 * MS
        mapped = clock.map(round(true * (1 + 100e-6)), true + DELAY)
    assert abs(mapped - true - DELAY) < 0.01 * MS


def test_a_time_is_never_later_than_its_reception_and_never_goes_back():
    chance, clock = random.Random(2), ClockMap()
    received = last = 0
    for k in range(1000):
        received = max(received, k * 2 * MS + chance.randrange(20 * MS))
        mapped = clock.map(k * 2 * MS, received)
        assert last <= mapped <= received
        last = mapped


def test_data_that_waited_in_a_buffer_keeps_its_old_time():
    clock = ClockMap()
    for k in range(100):
        clock.map(k * 2 * MS, k * 2 * MS + DELAY)
    read_at = 5000 * MS  # the program was stopped; its data waited
    mapped = clock.map(200 * MS, read_at)
    assert abs(mapped - 200 * MS - DELAY) < 1 * MS


def test_a_device_time_that_goes_back_is_reported_once():
    clock = ClockMap()
    clock.map(1000 * MS, 5000 * MS)
    assert clock.map(10 * MS, 5002 * MS) is None
    assert clock.map(12 * MS, 5004 * MS) == 5004 * MS


def test_a_device_time_that_jumps_ahead_is_reported_once():
    clock = ClockMap()
    clock.map(0, 0)
    assert clock.map(5000 * MS, 2 * MS) is None
    assert clock.map(5002 * MS, 4 * MS) == 4 * MS
