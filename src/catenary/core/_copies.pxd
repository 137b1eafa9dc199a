from libc.stdint cimport uint32_t

from catenary.core._memory cimport cat_memory
from catenary.core._native cimport cat_image
from catenary.core._numbers cimport number_t

cdef struct image_copy_t:      # bits of the input image that become bits of the output image
    uint32_t size              # whole bytes; 0: the bits of the two numbers
    uint32_t input_byte
    uint32_t output_byte
    number_t source
    number_t destination

cdef struct copies_t:
    cat_image *image
    image_copy_t *copies
    uint32_t count
    uint32_t ended             # 1: zeros are sent instead; set by any thread

cdef class Copies:
    """Owner of the table of copies between devices."""
    cdef copies_t c
    cdef cat_memory memory
    cdef int make_copy(self, image_copy_t *made, object copy, object plan) except -1

cdef void copies_write(copies_t *x) noexcept nogil
