from libc.stdint cimport int8_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._handover cimport actual_t, target_t
from catenary.core._memory cimport cat_memory
from catenary.core._native cimport cat_image
from catenary.core._numbers cimport number_t

cdef enum:  # bits of axis_flags; 6 and 7: the requested state in force
    FOLLOWED = 1
    LIMITED = 2
    DROPPED = 4
    REFUSED = 8
    FALLBACK = 16
    MODE_REFUSED = 32
    GOAL_SHIFT = 6

cdef enum:
    BANK_REAL = 0
    BANK_INTEGER = 1
    BANK_BIT = 2

cdef struct put_t:             # a set-point, as it stands in the output image
    double value               # NaN: not yet
    uint8_t cut                # the type could not hold it

cdef struct axis_t:
    # from the plan
    number_t controlword
    number_t statusword
    number_t mode_target
    number_t mode_actual
    number_t target_position
    number_t target_velocity
    number_t target_torque
    number_t actual_position
    number_t actual_velocity
    number_t actual_torque
    number_t position_demand   # 0x6062
    number_t torque_demand     # 0x6074
    number_t velocity_offset   # 0x60B1, where the application writes it
    uint32_t unit
    uint32_t divider           # its unit is exchanged every `divider` cycles
    double position_min
    double position_max
    double velocity_limit
    double torque_limit
    double step_limit          # [rad] of a CSP set-point; 0: by velocity limit and time
    double step_floor          # [rad] smallest default of it
    double acceleration        # [rad/s²] of return
    double deceleration        # [rad/s²] of fallback
    double torque_slope        # [N·m/s] of return
    double standstill          # [rad/s] at most: at rest
    uint8_t on_loss
    # observed
    uint8_t known              # its inputs were valid once
    uint8_t lost               # its unit was invalid lost_limit times in a row
    uint8_t state
    int8_t mode_shown
    uint16_t status
    uint32_t invalid_in_row    # exchanges of its unit
    int64_t read_at            # cycle start of its last valid inputs [ns]
    uint32_t still_cycles      # in a row, at rest
    uint64_t last_raw
    int64_t counts             # last_raw unwrapped to 64 bits
    double position
    double velocity
    double torque
    double demand_position
    double demand_torque
    # requested
    uint32_t request           # number of the last request taken over
    uint8_t goal               # requested state in force
    uint16_t command           # command bits of the controlword sent last
    int8_t mode                # in force: its set-points are followed
    int8_t mode_wanted         # sent in 0x6060
    int8_t mode_refused        # by the drive, until another one is requested
    uint8_t armed              # the application has committed targets since the request
    uint8_t stopping           # the core stopped it: quick stop rather than disable operation
    uint8_t holding            # the core stopped it and holds it in CSP (on_loss)
    uint8_t clear_reset        # bit 7 is kept clear once, so that it makes an edge
    uint8_t followed
    uint8_t worked             # was followed since OPERATION_ENABLED or since a mode change
    uint8_t tells              # bit 12 was seen: the drive has it
    uint8_t followed_at_stop   # bit 12 was shown when the stop began
    uint8_t flags
    uint8_t stop_reason
    uint64_t stop_cycle
    uint64_t followed_since    # cycle
    uint32_t climbing_cycles   # since the request, not followed yet
    uint32_t waiting_cycles    # powered, to be enabled, not followed
    uint32_t mute_cycles       # followed but for bit 12; stays at the limit
    uint32_t gap_cycles        # bit 12 was shown and is missing
    uint32_t stop_cycles       # powered since the stop
    uint32_t late_cycles       # in a row without an accepted set-point, but for a hand-over
    uint32_t refused_cycles    # of them, the target was refused
    uint32_t beyond_cycles     # in a row, outside a position limit and leaving
    # set-points: the last accepted one of CSP, and the way back to them
    double setpoint            # [rad]
    double setpoint_velocity   # [rad/s] between the last two
    double previous_velocity   # [rad/s] between the two before
    double ghost               # [rad] set-point of this cycle, continued by the core in a fallback
    double ghost_velocity      # [rad/s]
    uint64_t setpoint_stamp    # cycle it was meant for
    uint32_t fallback_cycles   # in a row without one
    uint8_t accepted           # 0, 1, 2: that many or more since followed
    uint8_t returning          # the command is on its way back to the set-points
    double command_velocity    # of the commanded position [rad/s]
    double offset_sent         # 0x60B1 of the application [rad/s]
    # sent
    uint8_t written            # the output image has all of it
    uint16_t controlword_sent  # all of its bits
    int8_t mode_sent
    put_t put_position
    put_t put_velocity
    put_t put_torque
    double commanded_position
    double commanded_velocity
    double commanded_torque

cdef struct column_t:
    number_t number
    uint8_t bank
    uint32_t rank              # in its bank

cdef struct area_t:             # bytes of an image, as they are
    uint32_t image_offset
    uint32_t place             # in the private bytes
    uint32_t size

cdef struct axes_t:
    cat_image *image
    uint32_t axis_count
    uint32_t input_count
    uint32_t output_count
    uint32_t input_area_count
    uint32_t output_area_count
    axis_t *axes
    column_t *input_columns
    column_t *output_columns
    area_t *input_areas
    area_t *output_areas
    double period              # [s]
    uint64_t number            # cycle whose inputs were read, or whose outputs are computed
    uint32_t lost_limit        # this and the following in cycles; 0: off
    uint32_t late_limit_position
    uint32_t late_limit_velocity
    uint32_t late_limit_torque
    uint32_t handover_limit    # CST keeps its torque in a hand-over
    uint32_t keep_limit        # CSP keeps its velocity in an underrun
    uint32_t mode_limit        # 0x6061 shows the requested mode
    uint32_t gap_limit         # bit 12 lost
    uint32_t stop_patience     # quick stop shows an effect
    uint32_t stop_patience_torque
    uint32_t cut_patience      # disable operation shows an effect
    uint32_t stop_limit        # a ramp of the drive takes at most this long
    uint32_t climbing_limit
    uint32_t mute_limit
    uint32_t still_limit
    uint32_t beyond_limit
    uint32_t command_timeout_velocity  # background: an update counts for so many cycles
    uint32_t command_timeout_torque
    uint32_t handed_over       # cycles in a row of a hand-over
    uint64_t handed_over_at    # cycle in which the last one began
    uint8_t background         # the targets are those of a program in the background
    uint8_t velocity_counts    # its last update is not older than the command timeout
    uint8_t torque_counts
    uint32_t stop_asked        # counts; from any thread
    uint32_t stop_seen
    uint32_t told              # flags of the cycle that its axes set
    uint32_t moving

cdef class Axes:
    """Owns the axis records and the tables of columns and areas."""
    cdef axes_t c
    cdef cat_memory memory

cdef void axes_read(axes_t *x, actual_t *out, uint64_t number, int64_t instant) noexcept nogil
cdef void axes_write(axes_t *x, const target_t *target, bint fresh, uint64_t number) noexcept nogil
cdef void axes_hand_over(axes_t *x) noexcept nogil
cdef bint axes_apply_late(axes_t *x, const target_t *target, bint fresh) noexcept nogil
cdef void axes_tell(axes_t *x, actual_t *out) noexcept nogil
cdef void axes_follow(const axes_t *x, const actual_t *actual, target_t *target) noexcept nogil
cdef void axes_follow_now(const axes_t *x, target_t *target) noexcept nogil
