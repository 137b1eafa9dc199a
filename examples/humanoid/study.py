"""Study of the humanoid's balance beside plain PD, in simulation and without a bus.

    python examples/humanoid/study.py

It prints a table, and writes plots and `study.json` to out/humanoid. The balance is compared with
the same joint gains under plain PD, PD with static torques, an LQR with a predictor, and a linear
policy at 100 Hz. One more row is plain PD with a joint stiffness like that of TOCABI's controllers.
`simulation.py` describes the pipeline and its delays.

- push: 60 N on the torso for the rest of the run, in four directions
- tilt: the floor slopes by 4 degrees in four directions, from the start
- sway: peak to peak of the centre of mass within 6 s of standing, with noise of the sensors
  (the dry friction of the joints keeps it small)
- impulse: the largest impulse of 0.1 s on the torso after which the robot stands, by bisection
- sensors lost: a push of 30 N forwards and backwards without the force sensors of the feet
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import body
import numpy as np
from balance import Balance
from lqr import Lqr
from policy import LIMIT, PolicyBalance, weights
from simulation import Control, Noise, Plain, Push, Result, Simulation

FORCE, SLOPE, LOST_FORCE = 60.0, np.radians(4.0), 30.0  # [N], [rad], [N]
DIRECTIONS = {"forward": (1, 0), "backward": (-1, 0), "left": (0, 1), "right": (0, -1)}
PUSH_TIME, SWAY_TIME, SETTLING, RECOVERY = 4.5, 6.0, 1.0, 2.6  # [s]
IMPULSE_LENGTH, IMPULSES, RESOLUTION = 0.1, (0.0, 60.0), 1.5  # [s], [N·s], [N·s]
FEET = ("left_foot_force", "right_foot_force")


def policy_balance() -> PolicyBalance:
    """Return the balance by the generated policy, computed by NumPy."""
    matrix = weights()
    return PolicyBalance(lambda observation, _now: np.clip(matrix @ observation, -LIMIT, LIMIT))


STIFF = "plain PD, stiff"
STIFF_JOINTS = {  # [N·m/rad]
    "waist_yaw": 6000.0,
    "waist_pitch": 10000.0,
    "waist_roll": 10000.0,
    "hip_yaw": 2000.0,
    "hip_roll": 5000.0,
    "hip_pitch": 4000.0,
    "knee": 3700.0,
    "ankle_pitch": 3200.0,
    "ankle_roll": 3200.0,
}
LAWS: dict[str, Callable[[], Control]] = {
    "plain PD": Plain,
    STIFF: Plain,
    "PD + static torque": lambda: Balance(feedback=False),
    "balance": Balance,
    "LQR": Lqr,
    "policy, 100 Hz": policy_balance,
}


def simulation(law: str, **options: Any) -> Simulation:
    """Return the simulation with the joint stiffness of a law.

    Args:
        law: Name in `LAWS`.
        options: Further arguments of `Simulation`.
    """
    stiffness = body.STIFFNESS.copy()
    for joint in body.JOINTS if law == STIFF else ():
        name = joint.name.removeprefix("left_").removeprefix("right_")
        stiffness[body.INDEX[joint.name]] = STIFF_JOINTS.get(name, joint.stiffness)
    return Simulation(stiffness=stiffness, **options)


def push(law: str, direction: str) -> Result:
    """Return the run with a lasting push of 60 N.

    Args:
        law: Name in `LAWS`.
        direction: Name in `DIRECTIONS`.
    """
    x, y = DIRECTIONS[direction]
    return simulation(law).run(LAWS[law](), PUSH_TIME, (Push((FORCE * x, FORCE * y)),))


def tilt(law: str, direction: str) -> Result:
    """Return the run on a floor that slopes down by 4 degrees.

    Args:
        law: Name in `LAWS`.
        direction: Name in `DIRECTIONS`.
    """
    x, y = DIRECTIONS[direction]
    return simulation(law, tilt=(SLOPE * x, SLOPE * y)).run(LAWS[law](), PUSH_TIME)


def sway(law: str) -> Result:
    """Return the run of quiet standing with noise of the sensors; `law` is a name in `LAWS`."""
    return simulation(law, noise=Noise()).run(LAWS[law](), SETTLING + SWAY_TIME)


def sway_of(run: Result) -> list[float]:
    """Return the sway along x and y [m]; infinite after a fall."""
    if run.fall:
        return [float("inf")] * 2
    quiet = run.com[run.time >= SETTLING]
    return [float(each) for each in np.ptp(quiet[:, :2], axis=0)]


def impulse(law: str, direction: str, resolution: float = RESOLUTION) -> float:
    """Return the largest impulse after which the robot stands [N·s].

    Args:
        law: Name in `LAWS`.
        direction: Name in `DIRECTIONS`.
        resolution: Largest error of the result [N·s].
    """
    body_of_law, control = simulation(law), LAWS[law]()
    low, high = IMPULSES
    while high - low > resolution:
        middle = (low + high) / 2
        x, y = (middle / IMPULSE_LENGTH * each for each in DIRECTIONS[direction])
        run = body_of_law.run(control, RECOVERY, (Push((x, y), 0.1, IMPULSE_LENGTH),))
        low, high = (low, middle) if run.fall else (middle, high)
    return low


def lost_sensors(law: str, lost: tuple[str, ...]) -> str:
    """Return the reason of a fall under 30 N forwards, then backwards, without some sensors.

    Args:
        law: Name in `LAWS`.
        lost: Names of the lost sensors.
    """
    pushes = Push((LOST_FORCE, 0.0), 0.5, 1.5), Push((-LOST_FORCE, 0.0), 2.5, 1.0)
    return simulation(law, lost=lost).run(LAWS[law](), 4.5, pushes).fall


def measure(law: str) -> dict[str, Any]:
    """Return all results of one law; `law` is a name in `LAWS`."""
    return {
        "push": {each: push(law, each) for each in DIRECTIONS},
        "tilt": {each: tilt(law, each) for each in DIRECTIONS},
        "sway": sway(law),
        "lost": {len(lost): lost_sensors(law, lost) for lost in (FEET[:1], FEET)},
    }


def study() -> dict[str, dict[str, Any]]:
    """Return the results of all laws, computed on all cores."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = {law: pool.submit(measure, law) for law in LAWS}
        pairs = [(law, direction) for law in LAWS for direction in DIRECTIONS]
        impulses = dict(zip(pairs, pool.map(impulse, *zip(*pairs, strict=True)), strict=True))
        return {
            law: {**each.result(), "impulse": {d: impulses[law, d] for d in DIRECTIONS}}
            for law, each in found.items()
        }


def outcome(runs: dict[str, Result]) -> str:
    """Return "stands" or the directions in which the robot falls, with the time of the fall."""
    falls = [f"{name} {run.time[-1]:.1f} s" for name, run in runs.items() if run.fall]
    return "falls: " + ", ".join(falls) if falls else "stands"


def summary(results: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the results as values of JSON."""
    return {
        law: {
            "push_60_n": outcome(found["push"]),
            "tilt_4_deg": outcome(found["tilt"]),
            "sway_mm": [round(1e3 * each, 3) for each in sway_of(found["sway"])],
            "impulse_n_s": {name: round(each, 1) for name, each in found["impulse"].items()},
            "one_foot_sensor_lost": found["lost"][1] or "stands",
            "both_foot_sensors_lost": found["lost"][2] or "stands",
        }
        for law, found in results.items()
    }


def table(rows: dict[str, dict[str, Any]]) -> str:
    """Return the results as text, one block per law."""
    lines = []
    for law, row in rows.items():
        impulses = ", ".join(f"{name} {each:g}" for name, each in row["impulse_n_s"].items())
        lines += [
            law,
            f"  push of {FORCE:g} N    {row['push_60_n']}",
            f"  floor tilted 4°  {row['tilt_4_deg']}",
            f"  sway             x {row['sway_mm'][0]:g} mm, y {row['sway_mm'][1]:g} mm",
            f"  largest impulse  {impulses} N·s",
            f"  {LOST_FORCE:g} N, lost sensors  one foot: {row['one_foot_sensor_lost']};"
            f" both: {row['both_foot_sensors_lost']}",
        ]
    return "\n".join(lines)


def plot(results: dict[str, dict[str, Any]], folder: Path) -> list[Path]:
    """Write the plots, and return their paths.

    Args:
        results: Results of `study`.
        folder: Existing folder.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    paths = []
    for name, title in (("push", "push of 60 N from 0.5 s"), ("tilt", "floor tilted by 4 degrees")):
        figure, rows = pyplot.subplots(2, 1, figsize=(9, 6), sharex=True, layout="constrained")
        for axes, direction in zip(rows, ("forward", "backward"), strict=True):
            for number, (law, found) in enumerate(results.items()):
                run, style = found[name][direction], ("-", "--")[number % 2]
                axes.plot(run.time, 1e3 * (run.com[:, 0] - run.com[0, 0]), style, label=law)
            axes.set(ylabel="CoM x [mm]", title=f"{title}, {direction}", ylim=(-200, 200))
            axes.grid(alpha=0.3)
        rows[0].legend(fontsize="small")
        rows[1].set_xlabel("time [s]")
        paths.append(_save(figure, folder / f"study_{name}.png"))
    paths.append(_plot_impulses(results, folder / "study_impulse.png"))
    return paths


def _plot_impulses(results: dict[str, dict[str, Any]], path: Path) -> Path:
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(9, 4), layout="constrained")
    for number, (law, found) in enumerate(results.items()):
        places = np.arange(len(DIRECTIONS)) + 0.14 * (number - 2.5)
        axes.bar(places, list(found["impulse"].values()), 0.13, label=law)
    axes.set(ylabel="largest impulse [N·s]", title="impulse of 0.1 s on the torso", ylim=(0, 65))
    axes.set_xticks(np.arange(len(DIRECTIONS)), list(DIRECTIONS))
    axes.legend(fontsize="small", ncols=3, loc="upper center")
    return _save(figure, path)


def _save(figure: Any, path: Path) -> Path:
    from matplotlib import pyplot

    figure.savefig(path, dpi=120)
    pyplot.close(figure)
    return path


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/humanoid"), help="output folder")
    parser.add_argument("--headless", action="store_true", help="write no plots")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    results = study()
    rows = summary(results)
    print(table(rows))
    (options.out / "study.json").write_text(json.dumps(rows, indent=2, ensure_ascii=False))
    for path in [] if options.headless else plot(results, options.out):
        print(path)


if __name__ == "__main__":  # the processes of the pool import this file
    main()
