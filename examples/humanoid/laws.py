"""Law of each network: impedance, friction and limits of the joints, and a damping mode.

The law runs in the cycle thread at 4 kHz. Its parameters are the command of the loop's body and the
constants of the joints. It enters the damping mode when the command requests it, and when the body
has not renewed its command for `Limits.silence`. It never ends by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba.extending import register_jitable

import catenary as cat
from catenary import control

Row = npt.NDArray[np.float64]

DAMPED, COMPLIANT = 0.0, 1.0  # values of MODE
# command: two numbers, then five rows of one number per axis
SIGN, MODE, FIRST = 0, 1, 2
GOAL, SPEED, TORQUE, STIFFNESS, DAMPING = range(5)
# constants: two numbers, then five rows of one number per axis
SILENCE, RISE = 0, 1
MOST, LOWER, UPPER, FASTEST, BRAKE = range(5)
# memory: last sign, its age [s], share of the command from 0 (damping) to 1
LAST, AGE, BLEND, STATES = 0, 1, 2, 3


@dataclass(frozen=True)
class Limits:
    """Constants of the law, one number per axis.

    Args:
        torque: largest torque (n,) [N·m].
        lower: smallest positions (n,) [rad].
        upper: largest positions (n,) [rad].
        speed: largest speeds (n,) [rad/s]. Above it, the law brakes.
        brake: damping (n,) [N·m·s/rad] of the damping mode, and beyond a limit.
        silence: age of a command at which the damping mode begins [s].
        rise: time from the damping mode to the full command [s].
    """

    torque: Row
    lower: Row
    upper: Row
    speed: Row
    brake: Row
    silence: float = 0.005
    rise: float = 0.3

    @property
    def parameters(self) -> Row:
        rows = (self.torque, self.lower, self.upper, self.speed, self.brake)
        return np.concatenate([[self.silence, self.rise], *rows])


class Command:
    """Owner of the parameters of the law of one network; the first `2 + 5 n` are its command."""

    def __init__(self, limits: Limits, friction: control.Friction) -> None:
        n = len(limits.torque)
        self._row = control.join(np.zeros(FIRST + 5 * n), limits.parameters, friction.parameters)
        start = int(self._row[1])
        self._head = self._row[start : start + FIRST]
        self._rows = self._row[start + FIRST : start + FIRST + 5 * n].reshape(5, n)

    @property
    def parameters(self) -> Row:
        return self._row

    def write(
        self, sign: int, mode: float, goal: Row, speed: Row, torque: Row, gains: tuple[Row, Row]
    ) -> Row:
        """Return the parameters for a command.

        Args:
            sign: number that differs from the previous one.
            mode: DAMPED or COMPLIANT.
            goal: positions (n,) [rad].
            speed: velocities of the goal (n,) [rad/s].
            torque: feed-forward torques (n,) [N·m].
            gains: stiffness (n,) [N·m/rad] and damping (n,) [N·m·s/rad].
        """
        self._head[:] = sign, mode
        self._rows[GOAL], self._rows[SPEED], self._rows[TORQUE] = goal, speed, torque
        self._rows[STIFFNESS], self._rows[DAMPING] = gains
        return self._row


@cat.law
def joints(actual, target, memory, parameters):
    """Compute the torques of all axes of one network."""
    command, constants = control.part(parameters, 0), control.part(parameters, 1)
    friction = control.part(parameters, 2)
    share = blend(memory, command, constants, actual.dt)
    for i in range(actual.n):
        q, v = actual.position[i], actual.velocity[i]
        wanted = control.friction(friction, i, row(command, SPEED, i, actual.n))
        wanted += impedance(command, i, actual.n, q, v)
        torque = share * wanted - (1.0 - share) * row(constants, BRAKE, i, actual.n) * v
        target.torque[i] = limited(constants, i, actual.n, torque, q, v)
    return False


@register_jitable
def row(block: Row, number: int, i: int, n: int) -> float:
    """Return a value of axis `i` of `n` from a row of the command or of the constants."""
    value: float = block[FIRST + number * n + i]
    return value


@register_jitable
def blend(memory: Row, command: Row, constants: Row, dt: float) -> float:
    """Return the share of the command, and update the age of the command in `memory`."""
    if command[SIGN] != memory[LAST]:
        memory[LAST] = command[SIGN]
        memory[AGE] = 0.0
    else:
        memory[AGE] += dt
    if command[MODE] == DAMPED or memory[AGE] > constants[SILENCE]:
        memory[BLEND] = 0.0
    else:
        memory[BLEND] = min(1.0, memory[BLEND] + dt / constants[RISE])
    share: float = memory[BLEND]
    return share


@register_jitable
def impedance(command: Row, i: int, n: int, q: float, v: float) -> float:
    """Return the torque of the spring and the damper of axis `i`, and its feed-forward [N·m]."""
    spring = row(command, STIFFNESS, i, n) * (row(command, GOAL, i, n) - q)
    damper = row(command, DAMPING, i, n) * (row(command, SPEED, i, n) - v)
    return spring + damper + row(command, TORQUE, i, n)


@register_jitable
def limited(constants: Row, i: int, n: int, torque: float, q: float, v: float) -> float:
    """Return the torque within the limits of axis `i` [N·m].

    Beyond a limit of position or speed, a torque that drives the axis further out is replaced by
    braking. A limit of the position therefore does not push the axis back: the command does.
    """
    brake, fastest = row(constants, BRAKE, i, n), row(constants, FASTEST, i, n)
    if q > row(constants, UPPER, i, n):
        torque = min(torque, -brake * v)
    if q < row(constants, LOWER, i, n):
        torque = max(torque, -brake * v)
    if v > fastest:
        torque = min(torque, -brake * (v - fastest))
    if v < -fastest:
        torque = max(torque, -brake * (v + fastest))
    most = row(constants, MOST, i, n)
    return min(max(torque, -most), most)
