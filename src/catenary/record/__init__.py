"""Recordings of a loop by another process, as MCAP files for PlotJuggler and Foxglove.

    catenary record arm arm.mcap            # next to the running program

    from catenary import record

    recording = record.read("arm.mcap")
    recording["position"], recording.time   # (cycles, axes) [rad], (cycles,) [s]
    record.plot(recording, "arm.png")

Like the dashboard, the package attaches to the share of a loop and has no other access to it.
"""

from catenary.record.figure import plot
from catenary.record.layout import Field, Layout
from catenary.record.log_file import read_csv
from catenary.record.merge import Merged, MergeInput, merge
from catenary.record.recorder import Recorder
from catenary.record.recording import Recording, read
from catenary.record.repair import Repaired, repair

__all__ = [
    "Field",
    "Layout",
    "MergeInput",
    "Merged",
    "Recorder",
    "Recording",
    "Repaired",
    "merge",
    "plot",
    "read",
    "read_csv",
    "repair",
]
