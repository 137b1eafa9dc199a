# cython: boundscheck=False, wraparound=False, cdivision=True
"""Copies between devices: bits of the input image that are sent as outputs of another device.

Theory of operation. The plan has a table of copies (`ImageCopy`). The cycle calls `copies_write`
after `axes_write`, so after the inputs of a cycle were collected and before the next frames leave.
A copy therefore takes one cycle, in every execution mode and with a law. The image keeps the last
valid inputs of a unit, and its first content is zero. So a copy repeats the last valid value while
its source is not valid, and sends zeros before the first valid value. Once `ended` is set, zeros
are sent. No other part writes these outputs (plan/output_owners.py).

Without copies, the cycle has a NULL pointer instead of the table, and makes one comparison.
Budget: 5 ns for each copy.
"""

from collections import namedtuple

from libc.stdint cimport uint32_t
from libc.string cimport memcpy, memset

from catenary.core._memory cimport cat_memory, cat_memory_free, memory_take
from catenary.core._native cimport cat_load_acquire32
from catenary.core._numbers cimport UNSIGNED, make_number, number_bits, number_put_bits

BITS_MAX = 64                  # of a copy that does not consist of whole bytes


cdef void copies_write(copies_t *x) noexcept nogil:
    """Write the outputs of all copies."""
    cdef const image_copy_t *copy = x.copies
    cdef const image_copy_t *end = copy + x.count
    cdef bint ended = cat_load_acquire32(&x.ended)
    while copy < end:
        if copy.size == 0:
            number_put_bits(&copy.destination, x.image.outputs,
                            0 if ended else number_bits(&copy.source, x.image.inputs))
        elif ended:
            memset(x.image.outputs + copy.output_byte, 0, copy.size)
        else:
            memcpy(x.image.outputs + copy.output_byte, x.image.inputs + copy.input_byte, copy.size)
        copy += 1


# ---- construction: the table is checked once, so that `copies_write` needs no checks

Bits = namedtuple("Bits", "bit_offset bit_length kind scale offset")


def unsigned(offset, length):
    """Return the place of bits in an image, as `make_number` needs it."""
    return Bits(offset, length, UNSIGNED, 1.0, 0.0)


cdef class Copies:
    def __cinit__(self, plan):
        cdef uint32_t k
        count = len(plan.copies)
        self.c.copies = <image_copy_t *>memory_take(&self.memory, count + 1, sizeof(image_copy_t))
        for k, copy in enumerate(plan.copies):
            self.make_copy(&self.c.copies[k], copy, plan)
        self.c.count = count

    cdef int make_copy(self, image_copy_t *made, copy, plan) except -1:
        """Set one copy. Raise ValueError if it is not possible."""
        where = f"copy {copy.name}"
        bits = copy.bit_length
        for bit, size in ((copy.input_bit, plan.input_size), (copy.output_bit, plan.output_size)):
            if bits < 1 or not 0 <= bit <= size * 8 - bits:
                raise ValueError(
                    f"{where}: bits {bit} to {bit + bits - 1} exceed the image of {size} bytes"
                )
        if bits % 8 == copy.input_bit % 8 == copy.output_bit % 8 == 0:
            made.size = bits // 8
            made.input_byte = copy.input_bit // 8
            made.output_byte = copy.output_bit // 8
            return 0
        if bits > BITS_MAX:
            raise ValueError(
                f"{where}: {bits} bits that are not whole bytes, must be at most {BITS_MAX}"
            )
        make_number(&made.source, unsigned(copy.input_bit, bits), plan.input_size, where)
        make_number(&made.destination, unsigned(copy.output_bit, bits), plan.output_size, where)
        return 0

    def __dealloc__(self):
        cat_memory_free(&self.memory)
