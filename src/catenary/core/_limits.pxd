"""Limits of commands, inlined where they are used."""

from libc.math cimport copysign, fabs, fmax, fmin

from catenary.core._axes cimport LIMITED, axis_t

cdef inline double clamp(axis_t *a, double value, double low, double high) noexcept nogil:
    if value < low:
        a.flags |= LIMITED
        return low
    if value > high:
        a.flags |= LIMITED
        return high
    return value

cdef inline double within_limits(axis_t *a, double target) noexcept nogil:
    """Return a target within the position limits.

    A command that is outside its limits may stay or return, but not move further away.
    """
    cdef double held = a.commanded_position
    return clamp(a, target, fmin(a.position_min, held), fmax(a.position_max, held))

cdef inline double approach(double value, double target, double step) noexcept nogil:
    """Return `value` moved towards `target` by at most `step`."""
    if fabs(target - value) <= step:
        return target
    return value + copysign(step, target - value)
