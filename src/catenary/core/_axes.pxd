from libc.stdint cimport int8_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._handover cimport actual_t, target_t
from catenary.core._memory cimport cat_memory
from catenary.core._motion cimport motion_t
from catenary.core._native cimport cat_image, cat_link
from catenary.core._numbers cimport number_t

cdef enum:  # bits of axis_flags; 6 and 7: the requested state in force
    FOLLOWED = 1
    LIMITED = 2
    DROPPED = 4
    REFUSED = 8
    FALLBACK = 16
    MODE_REFUSED = 32
    REQUESTED_SHIFT = 6

cdef enum:
    BANK_REAL = 0
    BANK_INTEGER = 1
    BANK_BIT = 2

cdef struct put_t:             # a set-point as encoded in the output image
    double value               # NaN: not set yet
    uint8_t cut                # saturated: the type could not hold the value

cdef struct axis_t:
    # constants from the plan
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
    number_t position_demand   # 0x6062, mapped or absent
    number_t torque_demand     # 0x6074
    number_t velocity_offset   # 0x60B1, if written by the application
    uint32_t unit
    uint32_t divider           # its unit is exchanged every `divider` cycles
    double position_min
    double position_max
    double velocity_limit
    double torque_limit
    double step_limit          # [rad] maximum step in CSP; 0: computed from velocity limit and time
    double step_floor          # [rad] smallest default step limit
    double acceleration        # [rad/s²] while the command returns to the set-points
    double deceleration        # [rad/s²] in a fallback
    double torque_slope        # [N·m/s] while the command returns to the set-points
    double standstill          # [rad/s] maximum velocity at rest
    uint8_t on_loss
    uint8_t sercos             # its words are S-0-0134 and S-0-0135 (_sercos.pyx)
    # observed
    uint8_t known              # its inputs were valid at least once
    uint8_t lost               # its unit was invalid lost_limit times in a row
    uint8_t state
    int8_t mode_shown
    uint16_t status
    uint32_t invalid_in_row    # number of invalid exchanges of its unit in a row
    int64_t read_at            # cycle start of its last valid inputs [ns]
    uint32_t still_cycles      # number of cycles in a row at rest
    uint64_t last_raw
    int64_t counts             # last_raw unwrapped to 64 bits
    double position
    double velocity
    double torque
    double demand_position
    double demand_torque
    # requested
    uint32_t request           # number of the last request that was processed
    uint8_t requested_state    # requested state in force
    uint16_t command           # command bits of the last controlword sent
    int8_t mode                # mode in force: the drive follows set-points of this mode
    int8_t mode_wanted         # requested mode, sent in 0x6060
    int8_t mode_refused        # mode that was refused; kept until another mode is requested
    uint8_t armed              # the application has committed targets since the request
    uint8_t stopping           # stopped by the core: quick stop instead of disable operation
    uint8_t holding            # stopped by the core and held in CSP (on_loss)
    uint8_t clear_reset        # keep bit 7 clear for one cycle, to create an edge
    uint8_t followed
    uint8_t jogged             # an operator moves it; it ignores the application
    uint8_t yielded            # holds after a jog, until the application commits a target for it
    uint8_t worked             # was followed since OPERATION_ENABLED or since a mode change
    uint8_t shows_following    # the drive has shown bit 12, so it implements the bit
    uint8_t followed_at_stop   # bit 12 was set when the stop began
    uint8_t flags
    uint8_t stop_reason
    uint64_t stop_cycle
    uint64_t followed_since    # number of the cycle
    uint32_t climbing_cycles   # cycles since the request during which the axis was not followed
    uint32_t waiting_cycles    # cycles while powered and requested enabled, but not followed
    uint32_t mute_cycles       # cycles in which only bit 12 is missing; stays at the limit
    uint32_t gap_cycles        # cycles since bit 12 was lost
    uint32_t stop_cycles       # cycles under power since the stop
    uint32_t late_cycles       # cycles in a row without an accepted set-point, hand-overs excluded
    uint32_t refused_cycles    # those of late_cycles with a refused target
    uint32_t beyond_cycles     # cycles in a row outside a position limit, moving further away
    # set-points: the last accepted one of CSP, and the return of the command to them
    double setpoint            # [rad]
    double setpoint_velocity   # [rad/s] velocity between the last two set-points
    double previous_velocity   # [rad/s] previous value of setpoint_velocity
    double ghost               # [rad] set-point of this cycle; extrapolated by the core in a fallback
    double ghost_velocity      # [rad/s]
    uint64_t setpoint_stamp    # number of the cycle for which it was computed
    uint32_t fallback_cycles   # cycles in a row without a set-point
    uint8_t accepted           # number of set-points accepted since followed, at most 2
    uint8_t returning          # the command is returning to the set-points
    double command_velocity    # velocity of the commanded position [rad/s]
    double offset_sent         # last 0x60B1 of the application [rad/s]
    # sent
    uint8_t written            # the output image is complete
    uint16_t controlword_sent  # last controlword, all bits
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
    uint32_t rank              # index in its bank

cdef struct area_t:             # bytes of an image, copied unchanged
    uint32_t image_offset
    uint32_t place             # offset in the private bytes
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
    uint64_t number            # cycle that read the inputs, or for which outputs are computed
    uint32_t lost_limit        # this and the following limits in cycles; 0: off
    uint32_t late_limit_position
    uint32_t late_limit_velocity
    uint32_t late_limit_torque
    uint32_t handover_limit    # maximum time for which CST keeps its torque in a hand-over
    uint32_t keep_limit        # maximum time for which CSP keeps its velocity in an underrun
    uint32_t mode_limit        # time until 0x6061 must show the requested mode
    uint32_t gap_limit         # time without bit 12 until the axis is stopped
    uint32_t stop_patience     # time until a quick stop must show an effect
    uint32_t stop_patience_torque
    uint32_t cut_patience      # time until disable operation must show an effect
    uint32_t stop_limit        # maximum duration of a drive's ramp
    uint32_t climbing_limit
    uint32_t mute_limit
    uint32_t still_limit
    uint32_t beyond_limit
    uint32_t command_timeout_velocity  # background: cycles for which an update is valid
    uint32_t command_timeout_torque
    uint32_t handed_over       # number of cycles of a hand-over so far
    uint64_t handed_over_at    # cycle in which the last hand-over began
    uint8_t background         # the targets come from a program in the background
    uint8_t velocity_counts    # the last velocity update is within the command timeout
    uint8_t torque_counts
    const cat_link *link       # clock of the motion requests
    motion_t motion            # requests of other processes
    uint32_t stop_asked        # number of stop requests, from any thread
    uint32_t stop_seen
    uint32_t cycle_flags       # flags of the cycle that its axes set
    uint32_t moving

cdef inline bint follows_application(const axis_t *a) noexcept nogil:
    """Return True if the axis follows the set-points of the application."""
    return a.followed and not a.jogged

cdef class Axes:
    """Owner of the axis records and column tables."""
    cdef axes_t c
    cdef cat_memory memory

cdef void axes_read(axes_t *x, actual_t *out, uint64_t number, int64_t instant) noexcept nogil
cdef void axes_write(axes_t *x, const target_t *target, bint fresh, uint64_t number) noexcept nogil
cdef void axes_hand_over(axes_t *x) noexcept nogil
cdef bint axes_apply_late(axes_t *x, const target_t *target, bint fresh) noexcept nogil
cdef void axes_report(axes_t *x, actual_t *out) noexcept nogil
cdef void axes_follow(const axes_t *x, const actual_t *actual, target_t *target) noexcept nogil
cdef void axes_follow_now(const axes_t *x, target_t *target) noexcept nogil
