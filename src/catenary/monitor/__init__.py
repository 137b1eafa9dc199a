"""Live views of a share outside of the browser: a terminal page, and a server for Foxglove.

    catenary top arm              # axes, bus and events in a terminal
    catenary foxglove arm         # for Foxglove and PlotJuggler

Like a recorder, the package attaches to the share of a loop and has no other access to it.
"""
