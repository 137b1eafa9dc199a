# cython: cdivision=True
"""Numbers in a process image: any bit offset, 1 to 64 bits, inlined where they are used.

Hosts must be little-endian (x86-64, ARM64). Images are padded, so that whole words may be accessed.
A number within one 64-bit word is shifted to the upper end and down again. Numbers that span nine
bytes or exceed an int64 use the slow functions (_numbers.pyx).
"""

from libc.stdint cimport int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcpy

cdef extern from "<math.h>" nogil:
    long long llrint(double value)  # rounds to nearest, halves to even: like rint, without a call

cdef enum:
    IMAGE_PADDING = 16         # bytes after an image: numbers are read and written as whole words

cdef enum:
    UNSIGNED = 0
    SIGNED = 1
    REAL = 2

cdef struct number_t:
    uint8_t present
    uint8_t kind
    uint8_t bits
    uint8_t shift              # position of the lowest bit in its byte
    uint8_t split              # the number spans nine bytes
    uint8_t left               # shift to the upper end of the word
    uint8_t right              # shift down again
    uint32_t byte
    uint64_t mask
    double scale
    double offset
    double low                 # lowest raw value, as far as a double can represent it
    double high
    int64_t lowest             # lowest raw value; the highest of 64 unsigned bits is 2^63 - 1 here
    int64_t highest

cdef uint64_t number_bits_split(const number_t *n, const uint8_t *image) noexcept nogil
cdef void number_put_bits_split(const number_t *n, uint8_t *image, uint64_t raw) noexcept nogil
cdef double number_real(const number_t *n, const uint8_t *image) noexcept nogil
cdef bint number_put_other(const number_t *n, uint8_t *image, double raw) noexcept nogil

cdef inline uint64_t number_word(const number_t *n, const uint8_t *image) noexcept nogil:
    """Return a word with the number at its upper end."""
    cdef uint64_t word
    if n.split:
        return number_bits_split(n, image) << n.right
    memcpy(&word, image + n.byte, 8)
    return word << n.left

cdef inline uint64_t number_bits(const number_t *n, const uint8_t *image) noexcept nogil:
    return number_word(n, image) >> n.right

cdef inline void number_put_bits(const number_t *n, uint8_t *image, uint64_t raw) noexcept nogil:
    cdef uint64_t word
    if n.split:
        number_put_bits_split(n, image, raw)
        return
    memcpy(&word, image + n.byte, 8)
    word = (word & ~(n.mask << n.shift)) | ((raw & n.mask) << n.shift)
    memcpy(image + n.byte, &word, 8)

cdef inline int64_t number_integer(const number_t *n, const uint8_t *image) noexcept nogil:
    """Return the raw value; unsigned 64-bit values of 2^63 and above wrap."""
    cdef uint64_t word = number_word(n, image)
    if n.kind == SIGNED:
        return (<int64_t>word) >> n.right
    return <int64_t>(word >> n.right)

cdef inline bint number_put_integer(const number_t *n, uint8_t *image, int64_t value) noexcept nogil:
    """Write a raw value; return True if it was saturated. A 64-bit type is never saturated."""
    cdef int64_t kept = value
    if n.bits < 64:
        kept = min(max(value, n.lowest), n.highest)
    number_put_bits(n, image, <uint64_t>kept)
    return kept != value

cdef inline double number_value(const number_t *n, const uint8_t *image) noexcept nogil:
    """Return the value in SI units."""
    cdef uint64_t word
    if n.kind == REAL:
        return number_real(n, image) * n.scale + n.offset
    word = number_word(n, image)
    if n.kind == SIGNED:
        return <double>((<int64_t>word) >> n.right) * n.scale + n.offset
    return <double>(word >> n.right) * n.scale + n.offset

cdef inline bint number_put_value(const number_t *n, uint8_t *image, double value) noexcept nogil:
    """Write a finite SI value, rounded; return True if it was saturated to the type's range. llrint
    is exact up to the limit of an int64, 9.2e18.
    """
    cdef double raw = (value - n.offset) / n.scale
    cdef int64_t rounded, kept
    if n.kind == REAL or not -9.2e18 < raw < 9.2e18:
        return number_put_other(n, image, raw)
    rounded = llrint(raw)
    kept = min(max(rounded, n.lowest), n.highest)
    number_put_bits(n, image, <uint64_t>kept)
    return kept != rounded

cdef inline bint number_put_wrapped(const number_t *n, uint8_t *image, double value) noexcept nogil:
    """Write like number_put_value, but keep the low bits of an integer beyond the type's range.
    Beyond int64, write nothing and return True.
    """
    cdef double raw
    if n.kind == REAL:
        return number_put_value(n, image, value)
    raw = (value - n.offset) / n.scale
    if not -9.2e18 < raw < 9.2e18:
        return True
    number_put_bits(n, image, <uint64_t>llrint(raw))
    return False

cdef int make_number(number_t *n, object plan, object image_size, object where) except -1
