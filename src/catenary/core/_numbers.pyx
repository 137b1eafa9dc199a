# cython: cdivision=True
"""Numbers in a process image: checked here once, read and written by the inline code of the .pxd."""

from libc.stdint cimport uint64_t

cdef double HIGHEST_SINGLE = 3.4028234663852886e38
cdef double HIGHEST_DOUBLE = 1.7976931348623157e308


cdef int make_number(number_t *n, object plan, object image_size, object where) except -1:
    """Fills `n` from a plan's Number; None: absent. ValueError names `where` and what is wrong."""
    n.present = 0
    if plan is None:
        return 0
    if plan.kind not in (UNSIGNED, SIGNED, REAL):
        raise ValueError(f"{where}: kind {plan.kind}")
    if not 1 <= plan.bit_length <= 64 or (plan.kind == REAL and plan.bit_length not in (32, 64)):
        raise ValueError(f"{where}: {plan.bit_length} bits")
    if not 0 <= plan.bit_offset <= image_size * 8 - plan.bit_length:
        raise ValueError(
            f"{where}: bits {plan.bit_offset} to {plan.bit_offset + plan.bit_length - 1} leave the"
            f" image of {image_size} bytes"
        )
    if not (isfinite(plan.scale) and plan.scale != 0 and isfinite(plan.offset)):
        raise ValueError(f"{where}: scale {plan.scale}, offset {plan.offset}")
    n.kind = plan.kind
    n.bits = plan.bit_length
    n.byte = plan.bit_offset // 8
    n.shift = plan.bit_offset % 8
    n.mask = <uint64_t>((1 << plan.bit_length) - 1)
    n.scale = plan.scale
    n.offset = plan.offset
    n.high = highest(plan.kind, plan.bit_length)
    n.low = -n.high if plan.kind == REAL else 0.0
    if plan.kind == SIGNED:
        n.low = -(2.0 ** (plan.bit_length - 1))
    n.present = 1
    return 0


cdef double highest(int kind, int bits) except? -1:
    """The largest double inside the type."""
    if kind == REAL:
        return HIGHEST_SINGLE if bits == 32 else HIGHEST_DOUBLE
    value_bits = bits - 1 if kind == SIGNED else bits
    return float((1 << value_bits) - (1 << max(value_bits - 53, 0)))
