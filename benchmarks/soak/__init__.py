"""The soak: random faults in virtual time against a running loop, and invariants that must hold.

setting: line or ring, clocks, mode of operation. cell: the machine. faults: incidents drawn by
chance. effects: the devices that each fault affects. injected: the faults that were on, and when.
witness: the invariants. commands: the limits of commands. objects: objects read meanwhile. minute:
the application. run: all minutes, and the report.
"""
