"""Control blocks for laws and for plain Python, and trajectories (docs/how_to/control_blocks.md).

A block has two parts. A value holds its settings (`Cascade(...)`) and provides `.parameters` and
`.memory` as flat rows of float64. A step function computes one step of one axis from these rows
(`cascade(memory, parameters, i, ...)`). All state is in `memory`. Fill it with zeros to reset the
block.
"""

# Step functions have up to ten parameters, because laws call them in code compiled by Numba, which
# does not support frozen options classes.
from catenary.control.action_rule import ActionReader, ActionRule, ActionStatus
from catenary.control.admittance import NaturalAdmittance, natural_admittance
from catenary.control.cartesian import CartesianImpedance, cartesian_impedance
from catenary.control.cascade import Cascade, cascade
from catenary.control.collision import Residual, Threshold, model_residual, residual, threshold
from catenary.control.coupling import Coupling, coupling
from catenary.control.delay import Delay, delay
from catenary.control.dynamics import Dynamics, gravity, inverse
from catenary.control.energy import EnergyResidual, energy_residual
from catenary.control.feed_forward import FeedForward, Friction, feed_forward, friction
from catenary.control.force_feedback import ForceFeedback, force_feedback
from catenary.control.homing import Homing, Stops, homed, homing, stops
from catenary.control.identification import Chirp, FrequencyResponse, chirp, frequency_response
from catenary.control.impedance import Impedance, impedance
from catenary.control.kinematics import Kinematics, jacobian, pose
from catenary.control.low_pass import LowPass, low_pass
from catenary.control.parts import every, join, part, restart
from catenary.control.passivity import Energies, Passivity, energies, passivity
from catenary.control.pid import Pid, pid
from catenary.control.policy import Policy
from catenary.control.trajectory import MotionLimits, MotionState, Trajectory, trajectory

__all__ = [
    "ActionReader",
    "ActionRule",
    "ActionStatus",
    "CartesianImpedance",
    "Cascade",
    "Chirp",
    "Coupling",
    "Delay",
    "Dynamics",
    "Energies",
    "EnergyResidual",
    "FeedForward",
    "ForceFeedback",
    "FrequencyResponse",
    "Friction",
    "Homing",
    "Impedance",
    "Kinematics",
    "LowPass",
    "MotionLimits",
    "MotionState",
    "NaturalAdmittance",
    "Passivity",
    "Pid",
    "Policy",
    "Residual",
    "Stops",
    "Threshold",
    "Trajectory",
    "cartesian_impedance",
    "cascade",
    "chirp",
    "coupling",
    "delay",
    "energies",
    "energy_residual",
    "every",
    "feed_forward",
    "force_feedback",
    "frequency_response",
    "friction",
    "gravity",
    "homed",
    "homing",
    "impedance",
    "inverse",
    "jacobian",
    "join",
    "low_pass",
    "model_residual",
    "natural_admittance",
    "part",
    "passivity",
    "pid",
    "pose",
    "residual",
    "restart",
    "stops",
    "threshold",
    "trajectory",
]
