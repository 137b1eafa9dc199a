"""Soak test: random faults in virtual time on a running loop, and invariants that must hold.

- setting: line or ring, clocks, mode of operation
- cell: the machine
- faults: random incidents
- effects: the devices that each fault affects
- injected: the active faults, and their times
- witness: the invariants
- commands: the limits of commands
- objects: objects that are read during the run
- minute: the application
- run: all minutes, and the report
"""
