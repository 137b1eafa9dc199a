"""Procedures (exchanges with devices), as generators without I/O and without a clock.

Unless its docstring specifies otherwise, a procedure also raises ResponseTimeout if a device does
not answer in time, and SegmentError if several devices answer to one station address.
"""
