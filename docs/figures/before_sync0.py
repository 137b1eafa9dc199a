"""Place of the frames before SYNC0, to scale: three drives at 1 kHz, default margin."""

from __future__ import annotations

from matplotlib.figure import Figure

MARGIN, WIRE, PERIOD = 200.0, 21.3, 1000.0  # [us], as in print(loop.plan) of the virtual cell
SYNC0 = MARGIN + WIRE


def draw() -> Figure:
    """Return the figure."""
    figure = Figure(figsize=(7.2, 1.9), layout="constrained")
    axes = figure.add_subplot()
    axes.barh(0, MARGIN, 0.4, 0, color="#eeeeee")
    axes.barh(0, WIRE, 0.4, MARGIN, color="#0000aa")
    for start in (SYNC0, SYNC0 + PERIOD):
        axes.plot((start, start), (-0.35, 0.55), color="#aa0000", linewidth=2)
        axes.text(start + 8, 0.42, "SYNC0", va="center", ha="left")
    for start in (0.0, PERIOD):
        axes.plot((start, start), (-0.35, 0.35), color="#aaaaaa", linestyle="--")
    axes.barh(0, MARGIN, 0.4, PERIOD, color="#eeeeee")
    axes.barh(0, WIRE, 0.4, PERIOD + MARGIN, color="#0000aa")
    axes.text(MARGIN / 2, 0, "margin", ha="center", va="center")
    axes.annotate(
        "frames on the wire",
        (MARGIN + WIRE / 2, -0.2),
        (MARGIN + 120, -0.36),
        va="center",
        arrowprops={"arrowstyle": "->", "color": "#000000"},
    )
    axes.set_xticks((0, PERIOD), ("cycle start", "next cycle start"))
    axes.set_yticks(())
    axes.set_xlim(-30, 1330)
    axes.set_ylim(-0.5, 0.6)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.set_xlabel("time [µs]; the period is 1000 µs")
    return figure
