# cython: cdivision=True
"""Numbers in a process image: checks and slow functions. The .pxd has the inline functions."""

from libc.math cimport isfinite, rint
from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t
from libc.string cimport memcpy

cdef double HIGHEST_SINGLE = 3.4028234663852886e38
cdef double HIGHEST_DOUBLE = 1.7976931348623157e308


# ---- slow functions

cdef uint64_t number_bits_split(const number_t *n, const uint8_t *image) noexcept nogil:
    cdef uint64_t word
    memcpy(&word, image + n.byte, 8)
    return (word >> n.shift | <uint64_t>image[n.byte + 8] << (64 - n.shift)) & n.mask


cdef void number_put_bits_split(const number_t *n, uint8_t *image, uint64_t raw) noexcept nogil:
    cdef uint64_t word
    cdef uint8_t high_mask = <uint8_t>(n.mask >> (64 - n.shift))
    raw &= n.mask
    memcpy(&word, image + n.byte, 8)
    word = (word & ~(n.mask << n.shift)) | (raw << n.shift)
    memcpy(image + n.byte, &word, 8)
    image[n.byte + 8] = (image[n.byte + 8] & ~high_mask) | <uint8_t>(raw >> (64 - n.shift))


cdef double number_real(const number_t *n, const uint8_t *image) noexcept nogil:
    """Return the raw value of a floating-point number."""
    cdef uint64_t raw = number_bits(n, image)
    cdef uint32_t raw32 = <uint32_t>raw
    cdef float single
    cdef double value
    if n.bits == 32:
        memcpy(&single, &raw32, 4)
        return single
    memcpy(&value, &raw, 8)
    return value


cdef bint number_put_other(const number_t *n, uint8_t *image, double raw) noexcept nogil:
    """Write a floating-point number, or an integer beyond int64; return True if it was
    saturated."""
    cdef uint64_t bits
    cdef uint32_t bits32
    cdef float single
    cdef double kept
    if n.kind != REAL:
        raw = rint(raw)
    kept = n.low if raw < n.low else n.high if raw > n.high else raw
    if n.kind == SIGNED:
        bits = <uint64_t><int64_t>kept
    elif n.kind == UNSIGNED:
        bits = <uint64_t>kept
    elif n.bits == 32:
        single = <float>kept
        memcpy(&bits32, &single, 4)
        bits = bits32
    else:
        memcpy(&bits, &kept, 8)
    number_put_bits(n, image, bits)
    return kept != raw


# ---- Python interface

cdef int make_number(number_t *n, object plan, object image_size, object where) except -1:
    """Set `n` from a plan's Number; None means absent. Raise ValueError if a field is invalid."""
    n.present = 0
    if plan is None:
        return 0
    if plan.kind not in (UNSIGNED, SIGNED, REAL):
        raise ValueError(f"{where}: unknown kind {plan.kind}")
    if not 1 <= plan.bit_length <= 64 or (plan.kind == REAL and plan.bit_length not in (32, 64)):
        raise ValueError(f"{where}: {plan.bit_length} bits, must be 1 to 64 (reals: 32 or 64)")
    if not 0 <= plan.bit_offset <= image_size * 8 - plan.bit_length:
        raise ValueError(
            f"{where}: bits {plan.bit_offset} to {plan.bit_offset + plan.bit_length - 1} exceed the"
            f" image of {image_size} bytes"
        )
    if not (isfinite(plan.scale) and plan.scale != 0 and isfinite(plan.offset)):
        raise ValueError(
            f"{where}: scale {plan.scale} and offset {plan.offset} must be finite, the scale not 0"
        )
    n.kind = plan.kind
    n.bits = plan.bit_length
    n.byte = plan.bit_offset // 8
    n.shift = plan.bit_offset % 8
    n.split = n.shift + n.bits > 64
    n.left = 0 if n.split else 64 - n.shift - n.bits
    n.right = 64 - n.bits
    n.mask = <uint64_t>((1 << plan.bit_length) - 1)
    n.scale = plan.scale
    n.offset = plan.offset
    n.high = highest(plan.kind, plan.bit_length)
    n.low = -n.high if plan.kind == REAL else 0.0
    if plan.kind == SIGNED:
        n.low = -(2.0 ** (plan.bit_length - 1))
    n.lowest, n.highest = whole_range(plan.kind, plan.bit_length)
    n.present = 1
    return 0


def whole_range(kind, bits):
    """Return the range of an integer's raw values, as far as an int64 holds them."""
    if kind == SIGNED:
        return -(1 << (bits - 1)), (1 << (bits - 1)) - 1
    return 0, (1 << min(bits, 63)) - 1


cdef double highest(int kind, int bits) except? -1:
    """Return the largest double within the type."""
    if kind == REAL:
        return HIGHEST_SINGLE if bits == 32 else HIGHEST_DOUBLE
    value_bits = bits - 1 if kind == SIGNED else bits
    return float((1 << value_bits) - (1 << max(value_bits - 53, 0)))
