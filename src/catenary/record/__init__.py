"""Recordings of a loop, by another process, as MCAP files that PlotJuggler and Foxglove open.

    with record.Recorder("arm", "arm.mcap") as recorder:   # or: catenary record arm arm.mcap
        while recorder.take(): ...

    recording = record.read("arm.mcap")
    recording["position"], recording["commanded_position"]  # (cycles, axes) [rad]
"""
