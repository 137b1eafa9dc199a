"""Results of `teleoperation.py`: figures, table and plot."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from coupling_laws import AXES, Controller
from device import hand_path

LEFT, RIGHT = 0, 1  # the left axis meets the block
TIME, STAMP, POSITION, TORQUE, ENERGY, HAND, DELAY = 0, 1, 2, 4, 6, 8, 10  # first columns of a row
RESTS = (2.7, 2.95), (4.7, 4.95), (7.2, 7.45), (9.75, 10.0)  # [s] at rest, the last without a hand
HEADINGS = {
    "network": "network, one way",
    "damping": "B [N·m·s/rad]",
    "bound": "measured delay [ms]",
    "moving": "error moving [mrad]",
    "resting": "at rest",
    "drift": "drift [mrad]",
    "stiffness": "felt stiffness [N·m/rad]",
    "felt": "felt / applied torque",
    "energy": "least energy [mJ]",
    "tolerance": "-ε [mJ]",
    "losses": "losses",
}


@dataclass(frozen=True)
class Result:
    """Rows of both sides at the same times, and the state of the link at the end."""

    name: str
    side: Controller  # of the leader
    leader: np.ndarray
    follower: np.ndarray
    losses: int

    @classmethod
    def aligned(cls, name, side, leader, follower):
        """Return the result of two programs, with the follower's rows at the leader's times."""
        columns = [np.interp(leader[:, STAMP], follower[:, STAMP], each) for each in follower.T]
        columns[TIME] = leader[:, TIME]
        losses = int((np.diff(leader[:, -1]) < 0).sum())
        return cls(name, side, leader, np.column_stack(columns), losses)

    def rest(self, rows, column, number):
        """Return the mean of a column during the rest `number`."""
        begin, end = RESTS[number]
        chosen = (rows[:, TIME] >= begin) & (rows[:, TIME] <= end)
        return float(rows[chosen, column].mean())

    def error(self, number, axis=RIGHT):
        """Return the distance of both sides at rest [rad]."""
        column = POSITION + axis
        return self.rest(self.leader, column, number) - self.rest(self.follower, column, number)

    @cached_property
    def summary(self):
        """Figures of the table, by the keys of HEADINGS."""
        apart = self.leader[:, POSITION + RIGHT] - self.follower[:, POSITION + RIGHT]
        errors = [self.error(number) for number in range(len(RESTS))]
        torque = [self.rest(self.leader, HAND + LEFT, number) for number in (1, 2)]
        place = [self.rest(self.leader, POSITION + LEFT, number) for number in (1, 2)]
        applied = self.rest(self.follower, TORQUE + LEFT, 2)
        energies = [rows[:, ENERGY : ENERGY + AXES] for rows in (self.leader, self.follower)]
        return {
            "network": self.name,
            "damping": float(self.side.damping),
            "bound": 1e3 * float(np.nanmax(self.leader[:, DELAY])),
            "moving": 1e3 * float(abs(apart).max()),
            "resting": 1e3 * max(map(abs, errors)),
            "drift": 1e3 * abs(errors[-1] - errors[0]),
            "stiffness": (torque[1] - torque[0]) / (place[1] - place[0]),
            "felt": torque[1] / applied if applied else float("nan"),
            "energy": 1e3 * min(float(rows.min()) for rows in energies),
            "tolerance": -1e3 * float(self.side.watch.tolerance.max()),
            "losses": self.losses,
        }


def table(results):
    """Return a text table, one line per network."""
    rows = [list(HEADINGS.values())]
    for result in results:
        rows.append([text(result.summary[key]) for key in HEADINGS])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True))
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


def text(value):
    """Return a figure with three digits."""
    return value if isinstance(value, str) else f"{value:.3g}"


def plot(results, path):
    """Write a figure with one column per network."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4 * len(results), 9), layout="constrained")
    axes = figure.subplots(3, len(results), sharex=True, squeeze=False)
    for column, result in zip(axes.T, results, strict=True):
        draw(column, result)
    for row, label in zip(axes, ("position [rad]", "torque [N·m]", "energy [J]"), strict=True):
        row[0].set_ylabel(label)
        row[0].legend(fontsize="small")
    figure.savefig(path, dpi=90)


def draw(column, result):
    """Draw the positions, torques and energies of a network."""
    time = result.leader[:, TIME]
    position, torque, energy = column
    position.set_title(result.name, fontsize="medium")
    position.plot(time, [hand_path(each) for each in time], "k:", lw=1, label="hand")
    sides = ("leader", result.leader, "C0"), ("follower", result.follower, "C1")
    for name, rows, color in sides:
        for axis, style, at in ((LEFT, "-", "left"), (RIGHT, "--", "right")):
            label = f"{name}, {at}"
            position.plot(time, rows[:, POSITION + axis], style, color=color, lw=1, label=label)
        torque.plot(time, rows[:, TORQUE + LEFT], color=color, lw=1, label=f"{name}, left")
        energy.plot(time, rows[:, ENERGY + LEFT], color=color, lw=1, label=f"seen by the {name}")
    for each in column:
        shade(each, time, result.leader[:, -1] < 0.5)
        each.grid(alpha=0.3)
    energy.set_xlabel("time [s]")


def shade(axes, time, lost):
    """Mark the times without a link."""
    axes.fill_between(
        time, 0, 1, where=lost, transform=axes.get_xaxis_transform(), color="0.85", lw=0
    )
