from libc.stdint cimport int8_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._handover cimport actual_t, target_t

cdef struct axis_record_t:     # the fields of AXIS_FIELDS
    double actual_position
    double actual_velocity
    double actual_torque
    double target_position
    double target_velocity
    double target_torque
    double commanded_position
    double commanded_velocity
    double commanded_torque
    uint16_t statusword
    uint16_t controlword
    int8_t mode
    uint8_t state
    uint8_t reserved[2]

cdef struct axis_log_t:
    uint8_t *rows              # NULL: axes are not logged
    uint64_t mask              # number of rows minus one, a power of two minus one
    uint32_t axes
    uint32_t row_size

cdef size_t axis_log_row_size(uint32_t axes) noexcept nogil
cdef void axis_log_put(axis_log_t *log, uint64_t number, const actual_t *actual,
                       const target_t *target) noexcept nogil
cdef bytes axis_log_row(const axis_log_t *log, uint64_t number)
