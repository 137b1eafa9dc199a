"""Conversations with devices, as generators without I/O and without a clock.

In addition to the documented exceptions, a procedure raises ResponseTimeout if a device does not
answer in time, and SegmentError if several devices answer to one station address.
"""
