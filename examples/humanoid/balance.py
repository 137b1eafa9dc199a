"""Balance of the humanoid on both feet: joint goals and torques for the impedance laws.

    estimator, balance = Estimator(), Balance()
    goal, torque = balance.step(estimator.step(measurement, dt), dt)

The law of each network computes  K (goal - q) - B dq/dt + torque  for each joint, with the gains of
`body.py`. The goals are the standing pose. The torques hold the robot in this pose (`statics.py`),
and push its centre of mass back:

    force = -(P e + D de/dt + I ∫e dt),   e: horizontal error of the centre of mass

A horizontal force on the centre of mass needs a shift of the centre of pressure under the feet, so
that most of it becomes torque of the ankles. The force is limited to what the soles can give.
It is a PI control of the centre of mass by the ankles, as for position-controlled humanoids (for
example Kajita et al., Biped walking stabilization, IROS 2010). Virtual model control (Pratt et al.,
IJRR 2001) involves the other joints of the legs.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import body
import numpy as np
from estimate import GRAVITY, Estimate, Estimator
from statics import Statics


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of the force on the centre of mass, for x and y.

    Attributes:
        stiffness: P [N/m].
        damping: D [N·s/m].
        integral: I [N/(m·s)].
        reach: Largest shift of the centre of pressure [m].
    """

    stiffness: tuple[float, float] = (3000.0, 3000.0)
    damping: tuple[float, float] = (1000.0, 1000.0)
    integral: tuple[float, float] = (4000.0, 4000.0)
    reach: tuple[float, float] = (0.12, 0.12)


class Balance:
    """Balance about the standing pose. The integral of the error is its only memory.

    Args:
        path: The MJCF file of the humanoid.
        gains: Gains of the force on the centre of mass.
        feedback: False leaves only the goals and the torques of the standing pose.
    """

    def __init__(
        self, path: str | Path = body.MODEL, *, gains: Gains = Gains(), feedback: bool = True
    ) -> None:
        statics = Statics(path)
        self.goal = body.STAND.copy()  # (33,) [rad]
        self.static_torque = statics.torque(self.goal)  # (33,) [N·m]
        self._push = statics.push(self.goal)
        standing = Estimator(path).standing
        self._target = standing.com[:2]
        self._feedback = feedback
        self._stiffness, self._damping, self._integral = (
            np.array(each) for each in (gains.stiffness, gains.damping, gains.integral)
        )
        self._limit = statics.mass * GRAVITY * np.array(gains.reach) / standing.com[2]
        self.force = np.zeros(2)  # [N] on the centre of mass
        self._sum = np.zeros(2)  # [N], integral part of the force

    def step(self, estimate: Estimate, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the goals (33,) [rad] and torques (33,) [N·m] of the joints.

        The torques are those of the standing pose while the estimate is not reliable.

        Args:
            estimate: State of the body.
            dt: Time since the previous step [s].
        """
        if not self._feedback or not estimate.reliable:
            return self.goal.copy(), self.static_torque.copy()
        error = self._target - estimate.com[:2]
        wanted = self._stiffness * error - self._damping * estimate.com_velocity[:2] + self._sum
        self.force = np.clip(wanted, -self._limit, self._limit)
        growing = (wanted != self.force) & (error * wanted > 0)  # the integral would wind up
        self._sum += np.where(growing, 0.0, self._integral * error * dt)
        return self.goal.copy(), self.static_torque + self._push @ self.force

    def reset(self) -> None:
        """Reset the integral of the error."""
        self._sum[:] = 0
        self.force[:] = 0
