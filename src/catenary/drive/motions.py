"""Moves of one axis, one step before each commit: our profile in CSP, the drive's own in PP.

PP is the set-point handshake of IEC 61800-7-201 / CiA 402-2: bit 4 of the controlword rises, bit 12
of the statusword acknowledges, bit 4 falls, bit 12 falls; bit 10 shows that the target is reached.
Bit 5 makes a set-point take effect at once. Each level is held until the drive has answered it.
"""

from __future__ import annotations

from collections.abc import Callable

from catenary.drive.objects import PROFILE_OBJECTS
from catenary.drive.port import AxisPort, Complaint, Steps, await_condition
from catenary.drive.profile import Motion, Profile, Rates, make_profile, make_stop
from catenary.errors import CatenaryError, SdoAbort
from catenary.wire.cia402 import Control, Object, Status

LATE = 0.05  # [s] without iterations, after which a profile begins again: late limit of CSP
SETTLE = 0.02  # [s] a set-point of CSP stays at the goal: the lag of a drive's position loop
ANSWER_TIMEOUT = 1.0  # [s] for an acknowledge of the drive
ANSWER_EXCHANGES = 4  # until the statusword can be the answer to a controlword
STILL = 0.02  # [s] at rest
STOP_TIMEOUT = 5.0  # [s] from halt to standstill
SLACK = (2.0, 5.0)  # times the expected duration, and seconds, until the drive must be there
CRUISE = 1 - 1e-9  # of the velocity: rounding must not look like a limited set-point

NEW_SET_POINT = int(Control.MODE_4)
AT_ONCE = int(Control.MODE_5)
HALT = int(Control.HALT)
OWN_BITS = NEW_SET_POINT | AT_ONCE | int(Control.MODE_6) | HALT
ACKNOWLEDGED = int(Status.MODE_12)
REACHED = int(Status.TARGET_REACHED)
OBJECT_MISSING = (0x06020000, 0x06090011)  # SDO abort codes: no object, no subindex


# ---- CSP


def first_motion(port: AxisPort) -> Motion:
    """Return the motion from which a profile begins: that of the last one, else the target.

    An axis that moves by other set-points goes on at its actual velocity.
    """
    if port.motion is not None:
        return port.motion
    return Motion(port.target, _velocity(port))


def move_cyclic(port: AxisPort, goal: float, rates: Rates) -> Steps:
    """Command our profile to `goal`, as a function of the time of the cycle."""
    slower = rates._replace(velocity=rates.velocity * CRUISE)
    yield from _command(port, lambda start: make_profile(start, goal, slower), SETTLE)


def stop_cyclic(port: AxisPort, rates: Rates) -> Steps:
    """Decelerate to rest and hold."""
    yield from _command(port, lambda start: make_stop(start, rates), 0.0)


def _command(port: AxisPort, make: Callable[[Motion], Profile], settle: float) -> Steps:
    """Command a profile.

    In a long pause of the iteration the core stops the axis. Then a new profile begins there.
    Otherwise the axis would catch up with the old one, faster than the move allows.
    """
    profile = make(first_motion(port))
    begun = port.now - port.period  # a set-point counts one cycle later
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
    """Hand a set-point to the drive, and wait until it has reached it."""
    way = make_profile(Motion(port.position, port.velocity), goal, rates._replace(jerk=None))
    patience = SLACK[0] * way.duration + SLACK[1]
    try:
        yield from _write_rates(port, rates)
        yield from _hand_over(port, goal)
        yield from _await_goal(port, goal, patience)
    except CatenaryError:
        port.set_bits(HALT)  # the drive may be on its way, to this goal or to the one before
        raise


def _await_goal(port: AxisPort, goal: float, patience: float) -> Steps:
    complaint = Complaint(
        f"did not show target reached (statusword bit 10) within {patience:.3g} s",
        "see its position window 0x6067, its limits 0x607D and 0x607F, and its state",
        goal,
    )
    yield from await_condition(port, lambda: port.has_bits(REACHED), patience, complaint)


def stop_profile(port: AxisPort) -> Steps:
    """Halt (bit 8, the ramp of 0x605D), then hold the position at which the axis stopped.

    Halt ends when the new set-point is acknowledged: before, the drive would go on to the old one.
    """
    port.clear_bits(NEW_SET_POINT | AT_ONCE)
    port.set_bits(HALT)
    yield from _pause(port, ANSWER_EXCHANGES * port.exchange)
    yield from _await_rest(port)
    yield from _hand_over(port, port.position)


def _hand_over(port: AxisPort, position: float) -> Steps:
    """Hand over one set-point, which takes effect at once."""
    if port.handshake:  # of the move before: the drive must see bit 4 fall
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
    """Wait until bit 12 is set, or is cleared."""
    what = "acknowledge the set-point" if shown else "accept another set-point"
    complaint = Complaint(
        f"did not {what} (statusword bit 12) within {ANSWER_TIMEOUT:g} s",
        "see its manual on profile position: some drives need a parameter for the handshake",
        goal,
    )
    yield from await_condition(
        port, lambda: port.has_bits(ACKNOWLEDGED) is shown, ANSWER_TIMEOUT, complaint
    )


def _pause(port: AxisPort, seconds: float) -> Steps:
    begun = port.now
    while port.now - begun < seconds:
        yield


def _await_rest(port: AxisPort) -> Steps:
    """Wait until the axis has been at rest for some time."""
    begun = still = port.now
    while port.now - still < STILL:
        if not port.at_rest:
            still = port.now
        if port.now - begun > STOP_TIMEOUT:
            hint = "see its halt option 0x605D and its deceleration 0x6084; Drives.quick_stop()"
            raise port.error(Complaint(f"did not stop within {STOP_TIMEOUT:g} s of halt", hint))
        yield


def _write_rates(port: AxisPort, rates: Rates) -> Steps:
    """Write velocity and ramps of the drive's profile: where they are mapped, else by SDO."""
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
            # 0x6084 is optional: the drive uses 0x6083 then
            if abort.code not in OBJECT_MISSING or place.index != Object.PROFILE_DECELERATION:
                raise
        port.written[name] = raw
