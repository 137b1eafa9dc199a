from libc.stdint cimport uint16_t

cdef enum:
    SYNCHRONISATION = 0x0400  # S-0-0134 bit 10

cdef uint16_t sercos_status(uint16_t status) noexcept nogil
cdef uint16_t sercos_control(uint16_t command, bint reacts) noexcept nogil
