"""Results of RDDA's experiments with our gripper, in virtual time.

Homing, stiffness and contact come from the printed results of `examples/gripper`. The frequency
response is measured here, with a chirp on the torque of the same finger. A constant torque keeps
the finger turning, so that dry friction is constant, too.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import catenary as cat
from catenary import control
from catenary.errors import CatenaryError
from catenary.virtual import Segment, Servo

PROGRAM = Path(__file__).resolve().parents[1] / "examples" / "gripper" / "gripper.py"
NEEDS = ("numba", "mujoco")
SECONDS = 600.0  # [s] limit of the program
PERIOD = 500e-6
INERTIA, VISCOUS, COULOMB = 2.7e-4, 2e-3, 0.01  # of a finger with its motor, as in examples/gripper
BIAS = 0.06  # [N·m]
DURATION = 30.0  # [s] of the sweep
SWEEP = control.Chirp(1, amplitude=0.02, first=0.2, last=100.0, duration=DURATION)  # [N·m]
SEGMENT = 2**14  # samples: a resolution of 0.12 Hz
COHERENT = 0.9  # smallest coherence of a frequency that counts


@dataclass(frozen=True, slots=True)
class Experiments:
    """Results in SI units; lists have a number per finger."""

    open_rad: list[float]
    closed_rad: list[float]
    meeting_rad: list[float]
    stiffness: list[tuple[float, list[float]]]  # configured, measured [N·m/rad]
    felt_ms: float  # time from contact to detection
    corner_rad_s: float  # -3 dB from torque to velocity
    expected_corner_rad_s: float  # of the simulated finger: friction / inertia


def why_not() -> str:
    """Return the reason why this machine cannot run the experiments; empty if it can."""
    missing = [name for name in NEEDS if find_spec(name) is None]
    if missing:
        return f"{', '.join(missing)} not installed (pip install 'catenary[law,sim]')"
    return ""


def run() -> Experiments:
    return read(printed(), corner())


def printed() -> str:
    """Run the example and return its output. Raises CatenaryError if it fails."""
    command = [sys.executable, str(PROGRAM)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
    if done.returncode:
        raise CatenaryError(f"{PROGRAM} failed: {done.stderr.strip()[-300:]}")
    return done.stdout


def read(text: str, corner_rad_s: float) -> Experiments:
    """Return the results in the output of the example. Raises CatenaryError if one is missing."""
    numbers: dict[str, list[list[float]]] = {}
    for line in filter(str.strip, text.splitlines()):
        found = [float(number) for number in re.findall(r"-?\d+\.\d+", line)]
        numbers.setdefault(line.split()[0], []).append(found)
    try:
        return Experiments(
            open_rad=numbers["open"][0],
            closed_rad=numbers["closed"][0],
            meeting_rad=numbers["meeting"][0],
            stiffness=[(first, rest) for first, *rest in numbers["stiffness"]],
            felt_ms=numbers["felt"][0][0],
            corner_rad_s=corner_rad_s,
            expected_corner_rad_s=VISCOUS / INERTIA,
        )
    except (LookupError, ValueError) as error:
        raise CatenaryError(f"{PROGRAM} printed no {error}") from error


@cat.law
def sweep(actual: Any, target: Any, memory: Any, time: Any, parameters: Any) -> bool:
    for i in range(actual.n):
        target.torque[i] = BIAS + control.chirp(parameters, 0, time)
    return bool(time > memory[0])


def corner() -> float:
    """Return the corner of the response from torque to velocity [rad/s]."""
    servo = Servo(inertia=INERTIA, viscous_friction=VISCOUS, coulomb_friction=COULOMB)
    count = round(DURATION / PERIOD)
    with cat.MainDevice(Segment([servo])) as main:
        arm = cat.Drives(
            main.scan().drives, mode="cst", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=PERIOD, laws=[sweep], log=count + 1000, log_axes=True) as loop:
            loop.run(sweep, memory=[DURATION], parameters=SWEEP.parameters)
            log = loop.log[-count:]
            (axis,) = log.axes
            torque, velocity = log[f"{axis}.target.torque"], log[f"{axis}.actual.velocity"]
    response = control.frequency_response(torque, velocity, PERIOD, segment=SEGMENT)
    return corner_of(response)


def corner_of(response: control.FrequencyResponse) -> float:
    """Return the frequency at which a first-order response has lost 3 dB [rad/s].

    The low-frequency gain is fitted: 1 / |response|² is linear in the squared frequency.
    """
    good = (response.coherence > COHERENT) & (response.frequency < 20.0)
    squared = (2 * math.pi * response.frequency[good]) ** 2
    power = abs(response.response[good]) ** 2
    slope, offset = np.polyfit(squared, 1 / power, 1, w=power)  # equal relative errors
    return float(math.sqrt(offset / slope))
