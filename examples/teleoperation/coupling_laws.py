"""Laws and gains of `device.py`: P+d at both sides, or the follower's torque at the leader.

Change these constants for your devices. They must be the same on both sides.
"""

from typing import NamedTuple

import numpy as np

import catenary as cat
from catenary import control

PERIOD, AXES = 1e-3, 2  # [s]
STIFFNESS = 2.0  # [N·m/rad] of the coupling, and of holding without a link
INERTIA = 1.5e-3  # [kg·m²], of an axis with its motor
FASTEST = 5.0  # [rad/s]
COUNTS = 2**20
ALIGN = 0.5  # [rad/s], speed at which a distance is closed after a loss
# The condition counts the delay from a measurement to the end of its effect. The link measures from
# sending to reception. A position waits up to one cycle before, and one cycle until the law starts.
WAITING = 4 * PERIOD  # of both directions
REACTION = 4 * PERIOD  # twice the reaction of a loop, see control.Coupling
SILENCE = 0.02  # [s] without a new cycle of this program, after which the law holds
MARGIN = 1.1  # of the damping
DAMPING_MAX = 2 * INERTIA / REACTION  # [N·m·s/rad]; more makes an axis oscillate
DELAY_MAX = 2 * (DAMPING_MAX / (MARGIN * STIFFNESS) - REACTION) - WAITING  # [s]
FADE = STIFFNESS * ALIGN  # [N·m/s]
CONNECTED, CYCLE, DAMPING, POSITIONS, ENERGIES, SPRINGS = 0, 1, 2, 3, 3 + AXES, 3 + 2 * AXES


@cat.law
def couple(actual, target, memory, parameters):
    """P+d, see `control.Coupling`, with an observer of the energy."""
    spring, port, seen = control.part(memory, 0), control.part(memory, 1), control.part(memory, 2)
    gains, watch = control.part(parameters, 0), control.part(parameters, 1)
    link = control.part(parameters, 2)
    seen[1] = seen[1] + actual.dt if link[CYCLE] == seen[0] else 0.0
    seen[0] = link[CYCLE]
    connected = link[CONNECTED] if seen[1] < SILENCE else 0.0
    for i in range(actual.n):
        q, v, dt = actual.position[i], actual.velocity[i], actual.dt
        pull = control.coupling(spring, gains, i, link[POSITIONS + i], connected, q, 0.0, dt)
        seen[3 + i] = pull  # without the damper, for force feedback
        total = pull - link[DAMPING] * v
        target.torque[i] = control.passivity(port, watch, i, total, link[ENERGIES + i], q, v, dt)


@cat.law
def reflect(actual, target, memory, parameters):
    """Proportional force feedback, see `control.ForceFeedback`. Without a link, it holds."""
    spring, port, seen = control.part(memory, 0), control.part(memory, 1), control.part(memory, 2)
    gains, watch = control.part(parameters, 0), control.part(parameters, 1)
    link, felt = control.part(parameters, 2), control.part(parameters, 3)
    seen[1] = seen[1] + actual.dt if link[CYCLE] == seen[0] else 0.0
    seen[0] = link[CYCLE]
    connected = link[CONNECTED] if seen[1] < SILENCE else 0.0
    begins, seen[2] = connected > seen[2], connected
    for i in range(actual.n):
        q, v, dt = actual.position[i], actual.velocity[i], actual.dt
        total = control.coupling(spring, gains, i, link[POSITIONS + i], connected, q, v, dt)
        if connected == 1.0:
            torque = control.force_feedback(felt, i, link[SPRINGS + i], v)
            if begins:
                seen[3 + i] = total - torque  # begin with the torque of holding
            step = FADE * dt
            seen[3 + i] -= min(max(seen[3 + i], -step), step)
            total = torque + seen[3 + i]
        target.torque[i] = control.passivity(port, watch, i, total, link[ENERGIES + i], q, v, dt)


class Controller(NamedTuple):
    """Law of one side, and its settings."""

    law: object  # made by `cat.law`
    coupling: control.Coupling
    watch: control.Passivity
    feedback: control.ForceFeedback | None
    weight: float  # of this side's energies, divided by that of the follower's

    @property
    def damping(self):
        """Damping of this side [N·m·s/rad]."""
        return self.coupling.damping

    @property
    def memory(self):
        """Initial memory of the law: coupling, observer, then states of the law itself."""
        return control.join(self.coupling.memory, self.watch.memory, np.zeros(3 + AXES))

    def parameters(self, connected, cycle, positions, energies, springs):
        """Return the parameters of the law for the newest state of the other side."""
        link = [float(connected), float(cycle), self.damping, *positions, *energies, *springs]
        felt = [] if self.feedback is None else [self.feedback.parameters]
        return control.join(self.coupling.parameters, self.watch.parameters, link, *felt)


def controller(max_delay, damping=None, *, feedback=None, added=0.0):
    """Return the controller of one side.

    Args:
        max_delay: bound of the delay of both directions together [s].
        damping: damping [N·m·s/rad]; None: by the delay.
        feedback: gain of the follower's torque at a leader; None for P+d.
        added: largest damping that the passivity controller adds [N·m·s/rad].

    Raises:
        ValueError: the gains are not stable with this delay.
    """
    check_delay(max_delay)
    felt, weight, law = None, 1.0, couple
    if feedback is None:
        gains = gains_for(max_delay, damping)
    else:
        felt = feedback_for(max_delay, feedback, damping)
        weight, law = feedback, reflect
        gains = gains_for(0.0, felt.damping)  # to hold, which needs no delay
    if not 0.0 <= added <= DAMPING_MAX - gains.damping:
        raise ValueError(
            f"added damping of {added:g} N·m·s/rad: with {gains.damping:.3g} N·m·s/rad of the "
            f"coupling, use 0 to {max(DAMPING_MAX - gains.damping, 0.0):.3g} N·m·s/rad; more makes "
            f"an inertia of {INERTIA:g} kg·m² oscillate"
        )
    quantum = 2 * np.pi / COUNTS
    watch = control.Passivity(AXES, weight * STIFFNESS, FASTEST, PERIOD, quantum, damping=added)
    return Controller(law, gains, watch, felt, weight)


def check_delay(max_delay):
    """Raise ValueError if no damping permits a delay."""
    if not 0.0 <= max_delay <= DELAY_MAX:
        raise ValueError(
            f"a delay of {max_delay:g} s in both directions together: use 0 to {DELAY_MAX:.2g} s. "
            f"A longer delay needs more than {DAMPING_MAX:.3g} N·m·s/rad of damping, which makes "
            f"an inertia of {INERTIA:g} kg·m² oscillate; a lower STIFFNESS in coupling_laws.py "
            "permits a longer delay"
        )


def damping_for(max_delay):
    """Return a damping [N·m·s/rad] that permits a delay [s] of both directions together."""
    return MARGIN * STIFFNESS * ((max_delay + WAITING) / 2 + REACTION)


def gains_for(max_delay, damping=None):
    """Return the coupling of one side, the same on both. Raises ValueError if it is not stable."""
    damping = damping_for(max_delay) if damping is None else damping
    return control.Coupling(
        AXES, STIFFNESS, damping, max_delay + WAITING, PERIOD, align=ALIGN, inertia=INERTIA
    )


def feedback_for(max_delay, gain, damping=None):
    """Return the force feedback of a leader. Raises ValueError if it is not passive.

    The follower refuses less damping than its condition needs, so the limit counts with this one.
    """
    if not gain > 0.0:
        raise ValueError(f"a feedback of {gain:g} must be above 0")
    follower = STIFFNESS, damping_for(max_delay) / MARGIN

    def made(value, damping):
        return control.ForceFeedback(AXES, value, damping, follower, max_delay + WAITING, PERIOD)

    if damping is None:
        per_gain = MARGIN / float(made(0.0, 1.0).largest_gain[0])  # [N·m·s/rad]
        if gain * per_gain > DAMPING_MAX:
            raise ValueError(
                f"a feedback of {gain:g} with a delay of {max_delay:g} s: use at most "
                f"{DAMPING_MAX / per_gain:.2g}, or a shorter delay"
            )
        damping = max(gain * per_gain, damping_for(0.0))
    return made(gain, damping)
