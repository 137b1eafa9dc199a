"""Numbers in a process image: any bit offset, 1 to 64 bits, inlined where they are used.

Little endian hosts (x86-64, ARM64). Images are padded, so that whole words may be touched.
"""

from libc.math cimport isfinite, rint
from libc.stdint cimport int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcpy

cdef enum:
    IMAGE_PADDING = 16         # bytes behind an image: numbers are read and written as whole words

cdef enum:
    UNSIGNED = 0
    SIGNED = 1
    REAL = 2

cdef struct number_t:
    uint8_t present
    uint8_t kind
    uint8_t bits
    uint8_t shift              # of its lowest bit, in the byte
    uint32_t byte
    uint64_t mask
    double scale
    double offset
    double low                 # of the raw value, as far as a double can say
    double high

cdef inline uint64_t number_bits(const number_t *n, const uint8_t *image) noexcept nogil:
    cdef uint64_t word
    memcpy(&word, image + n.byte, 8)
    word >>= n.shift
    if n.shift + n.bits > 64:
        word |= <uint64_t>image[n.byte + 8] << (64 - n.shift)
    return word & n.mask

cdef inline void number_put_bits(const number_t *n, uint8_t *image, uint64_t raw) noexcept nogil:
    cdef uint64_t word
    cdef uint8_t high_mask
    raw &= n.mask
    memcpy(&word, image + n.byte, 8)
    word = (word & ~(n.mask << n.shift)) | (raw << n.shift)
    memcpy(image + n.byte, &word, 8)
    if n.shift + n.bits > 64:
        high_mask = <uint8_t>(n.mask >> (64 - n.shift))
        image[n.byte + 8] = (image[n.byte + 8] & ~high_mask) | <uint8_t>(raw >> (64 - n.shift))

cdef inline int64_t number_integer(const number_t *n, const uint8_t *image) noexcept nogil:
    """The raw value; unsigned 64-bit ones beyond 2^63 wrap."""
    cdef uint64_t raw = number_bits(n, image)
    if n.kind == SIGNED:
        return (<int64_t>(raw << (64 - n.bits))) >> (64 - n.bits)
    return <int64_t>raw

cdef inline bint number_put_integer(const number_t *n, uint8_t *image, int64_t value) noexcept nogil:
    """Writes a raw value; whether it had to be cut to the type's range. 64 bits take all there is."""
    cdef int64_t low = 0, high, kept = value
    if n.bits < 64:
        high = <int64_t>n.mask
        if n.kind == SIGNED:
            high >>= 1
            low = -high - 1
        kept = min(max(value, low), high)
    number_put_bits(n, image, <uint64_t>kept)
    return kept != value

cdef inline double number_value(const number_t *n, const uint8_t *image) noexcept nogil:
    """In SI units."""
    cdef uint64_t raw
    cdef uint32_t raw32
    cdef float single
    cdef double value
    if n.kind == REAL:
        raw = number_bits(n, image)
        if n.bits == 32:
            raw32 = <uint32_t>raw
            memcpy(&single, &raw32, 4)
            value = single
        else:
            memcpy(&value, &raw, 8)
    elif n.kind == SIGNED:
        value = <double>number_integer(n, image)
    else:
        value = <double>number_bits(n, image)
    return value * n.scale + n.offset

cdef inline bint number_put_value(const number_t *n, uint8_t *image, double value) noexcept nogil:
    """Writes a finite SI value, rounded; whether it had to be cut to the type's range."""
    cdef double raw = (value - n.offset) / n.scale
    cdef uint64_t bits
    cdef uint32_t bits32
    cdef float single
    cdef bint cut = False
    if n.kind != REAL:
        raw = rint(raw)
    if raw < n.low:
        raw = n.low
        cut = True
    elif raw > n.high:
        raw = n.high
        cut = True
    if n.kind == REAL:
        if n.bits == 32:
            single = <float>raw
            memcpy(&bits32, &single, 4)
            bits = bits32
        else:
            memcpy(&bits, &raw, 8)
    elif n.kind == SIGNED:
        bits = <uint64_t><int64_t>raw
    else:
        bits = <uint64_t>raw
    number_put_bits(n, image, bits)
    return cut

cdef inline bint number_put_wrapped(const number_t *n, uint8_t *image, double value) noexcept nogil:
    """As number_put_value, but a counter that is beyond its range goes round: its low bits."""
    cdef double raw
    if n.kind == REAL:
        return number_put_value(n, image, value)
    raw = rint((value - n.offset) / n.scale)
    if not -9.2e18 < raw < 9.2e18:
        return True
    number_put_bits(n, image, <uint64_t><int64_t>raw)
    return False

cdef int make_number(number_t *n, object plan, object image_size, object where) except -1
