"""Moves of one axis, as generators that run one step before each commit.

In CSP, the generator computes the profile. In PP, the drive does, and the generator runs the
set-point handshake of IEC 61800-7-201 / CiA 402-2:

1. Bit 4 of the controlword rises.
2. Bit 12 of the statusword rises as the acknowledgement.
3. Bit 4 falls, then bit 12 falls.
4. Bit 10 of the statusword shows that the target is reached.

Bit 5 of the controlword makes a set-point take effect immediately. Each bit keeps its level until
the drive has replied.
"""

from __future__ import annotations

from collections.abc import Callable

from catenary.drive.objects import PROFILE_OBJECTS
from catenary.drive.port import AxisPort, Failure, Steps, await_condition
from catenary.drive.profile import Motion, Profile, Rates, make_profile, make_stop
from catenary.errors import CatenaryError, SdoAbort
from catenary.wire.cia402 import Control, Object, Status

LATE = 0.05  # [s] without iterations, after which a profile starts again (late limit of CSP)
SETTLE = 0.02  # [s] at the goal in CSP, for the lag of the position loop of a drive
ANSWER_TIMEOUT = 1.0  # [s] for an acknowledgement of the drive
ANSWER_EXCHANGES = 4  # until the statusword reflects a new controlword
STILL = 0.02  # [s] an axis below the standstill velocity for this time is at rest
STOP_TIMEOUT = 5.0  # [s] from halt to standstill
SLACK = (2.0, 5.0)  # timeout of a move: factor of the expected duration, and additional seconds
CRUISE = 1 - 1e-9  # factor of the velocity, so that rounding does not exceed the limit

NEW_SET_POINT = int(Control.MODE_4)
AT_ONCE = int(Control.MODE_5)
HALT = int(Control.HALT)
OWN_BITS = NEW_SET_POINT | AT_ONCE | int(Control.MODE_6) | HALT
ACKNOWLEDGED = int(Status.MODE_12)
REACHED = int(Status.TARGET_REACHED)
OBJECT_MISSING = (0x06020000, 0x06090011)  # SDO abort codes: no object, no subindex


# ---- CSP


def first_motion(port: AxisPort) -> Motion:
    """Return the motion from which a profile starts.

    This is the last command of the present profile. Without one, it is the target, with the actual
    velocity of the axis.
    """
    if port.motion is not None:
        return port.motion
    return Motion(port.target, _velocity(port))


def move_cyclic(port: AxisPort, goal: float, rates: Rates) -> Steps:
    """Command a profile to a goal in CSP, as a function of the cycle time.

    Args:
        port: the axis.
        goal: position at the end.
        rates: limits of the profile.
    """
    slower = rates._replace(velocity=rates.velocity * CRUISE)
    yield from _command(port, lambda start: make_profile(start, goal, slower), SETTLE)


def stop_cyclic(port: AxisPort, rates: Rates) -> Steps:
    """Decelerate to rest in CSP, and hold the position."""
    yield from _command(port, lambda start: make_stop(start, rates), 0.0)


def _command(port: AxisPort, make: Callable[[Motion], Profile], settle: float) -> Steps:
    """Command a profile.

    If the iteration pauses for too long, the core stops the axis. A new profile then starts from
    there. Otherwise the axis would catch up with the old profile faster than the move allows.
    """
    profile = make(first_motion(port))
    begun = port.now - port.period  # a set-point takes effect one cycle later
    while port.now - begun < profile.duration + settle:
        port.command(profile.at(port.now - begun))
        last = port.now
        yield
        if port.now - last > max(LATE, 2 * port.period):
            profile = make(Motion(port.position, _velocity(port)))
            begun = port.now - port.period
    port.command(Motion(profile.goal))


def _velocity(port: AxisPort) -> float:
    return 0.0 if port.at_rest else port.velocity


# ---- PP


def move_profile(port: AxisPort, goal: float, rates: Rates) -> Steps:
    """Send a set-point to the drive in PP, and wait until the drive has reached it.

    Args:
        port: the axis.
        goal: position at the end.
        rates: limits of the profile.

    Raises:
        MoveError: The drive does not acknowledge the set-point, or does not reach it in time.
        CatenaryError: The drive does not accept a rate by SDO.

    After such an error, halt (bit 8) stays set.
    """
    expected = make_profile(Motion(port.position, port.velocity), goal, rates._replace(jerk=None))
    timeout = SLACK[0] * expected.duration + SLACK[1]
    try:
        yield from _write_rates(port, rates)
        yield from _hand_over(port, goal)
        yield from _await_goal(port, goal, timeout)
    except CatenaryError:
        port.set_bits(HALT)  # the drive may still be moving to this goal or to the previous one
        raise


def _await_goal(port: AxisPort, goal: float, timeout: float) -> Steps:
    failure = Failure(
        f"did not report that it reached the target (statusword bit 10) within {timeout:.3g} s",
        "check its position window 0x6067, its limits 0x607D and 0x607F, and its state",
        goal,
    )
    yield from await_condition(port, lambda: port.has_bits(REACHED), timeout, failure)


def stop_profile(port: AxisPort) -> Steps:
    """Stop with halt (bit 8, ramp of 0x605D), then hold the position at standstill.

    Halt stays set until the drive has acknowledged the new set-point. Otherwise the drive would
    continue to the previous set-point.

    Raises:
        MoveError: The axis does not stop in time, or the drive does not acknowledge the set-point.
    """
    port.clear_bits(NEW_SET_POINT | AT_ONCE)
    port.set_bits(HALT)
    yield from _pause(port, ANSWER_EXCHANGES * port.exchange)
    yield from _await_rest(port)
    yield from _hand_over(port, port.position)


def _hand_over(port: AxisPort, position: float) -> Steps:
    """Send one set-point, which takes effect immediately."""
    if port.handshake:  # the previous handshake did not end; the drive must see bit 4 fall
        port.clear_bits(NEW_SET_POINT)
        yield from _pause(port, ANSWER_EXCHANGES * port.exchange)
    yield from _await_acknowledge(port, False, position)
    port.set_target(position)
    port.handed_over = None
    port.set_bits(NEW_SET_POINT | AT_ONCE)
    port.handshake = True
    yield
    yield from _await_acknowledge(port, True, position)
    port.handed_over = position
    port.clear_bits(NEW_SET_POINT | AT_ONCE | HALT)
    yield from _await_acknowledge(port, False, position)
    port.handshake = False


def _await_acknowledge(port: AxisPort, shown: bool, goal: float) -> Steps:
    """Wait until bit 12 of the statusword is set (`shown`) or cleared."""
    what = "acknowledge the set-point" if shown else "become ready for another set-point"
    failure = Failure(
        f"did not {what} (statusword bit 12) within {ANSWER_TIMEOUT:g} s",
        "see profile position mode in its manual; some drives need a parameter for the handshake",
        goal,
    )
    yield from await_condition(
        port, lambda: port.has_bits(ACKNOWLEDGED) is shown, ANSWER_TIMEOUT, failure
    )


def _pause(port: AxisPort, seconds: float) -> Steps:
    begun = port.now
    while port.now - begun < seconds:
        yield


def _await_rest(port: AxisPort) -> Steps:
    """Wait until the axis has been at rest for the time STILL.

    Raise MoveError after STOP_TIMEOUT.
    """
    begun = still = port.now
    while port.now - still < STILL:
        if not port.at_rest:
            still = port.now
        if port.now - begun > STOP_TIMEOUT:
            hint = (
                "check its halt option 0x605D and deceleration 0x6084, or use Drives.quick_stop()"
            )
            raise port.error(Failure(f"did not stop within {STOP_TIMEOUT:g} s after halt", hint))
        yield


def _write_rates(port: AxisPort, rates: Rates) -> Steps:
    """Write velocity and ramps of the profile, by SDO if they are not mapped."""
    values = (rates.velocity, rates.acceleration, rates.acceleration)
    for (name, place), value in zip(PROFILE_OBJECTS.items(), values, strict=True):
        raw = max(1, round(value / abs(port.units.velocity_scale)))
        if port.put_rate(name, value) or port.written.get(name) == raw:
            continue
        answer = port.write_object(place.index, raw)
        while not answer.done:
            yield
        try:
            answer.result()
        except SdoAbort as abort:
            # 0x6084 is optional; a drive without it uses 0x6083
            if abort.code not in OBJECT_MISSING or place.index != Object.PROFILE_DECELERATION:
                raise
        port.written[name] = raw
