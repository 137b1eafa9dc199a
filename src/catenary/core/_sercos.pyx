# cython: boundscheck=False, wraparound=False
"""SERCOS drives, IEC 61800-7-204: status word S-0-0135 → statusword, controlword → S-0-0134.

Theory of operation. The core has one state machine, CiA 402 (_cia402.pyx, _guard.pyx). These two
tables translate the words of a SERCOS drive where an axis is read and written (_axes.pyx), so that
every state, limit and stop is that of a CiA 402 axis. Bits 15 and 14 of S-0-0135 are the state, bit
13 is an error of class 1, and bit 3 is set while the drive follows its command values.

A stop clears bit 15 of S-0-0134 (drive off) and keeps bit 14: the drive brakes, closes its brake
within S-0-0207, and then removes the torque itself. Bits 15 and 14 of S-0-0135 remain set, and bit 3
is clear. A request to enable waits until this ends. The end of bit 14 removes the torque at once.
A fault is reset by the procedure command S-0-0099 through the mailbox, since S-0-0134 has no bit
for it.
Source: Beckhoff, AX5000, description of S-0-0134 and S-0-0135. Bit 10 of S-0-0134
(synchronisation) toggles with the command values, as in linuxcnc-ethercat (lcec_class_ax5.c).

Budget: two table look-ups per SERCOS axis, one compare for other axes.
"""

from libc.stdint cimport uint8_t, uint16_t


STATUS = (
    # mask, value of S-0-0135, statusword
    (0xE000, 0xE000, 0x000F),  # error of class 1 in operation: fault reaction active
    (0x2000, 0x2000, 0x0008),  # error of class 1: fault
    (0xC000, 0x0000, 0x0000),  # not ready to switch on
    (0xC000, 0x4000, 0x0040),  # ready, but without mains power: switch on disabled
    (0xC000, 0x8000, 0x0023),  # powered: switched on
    (0xC008, 0xC008, 0x1027),  # operation enabled, follows the command values (bit 12)
    (0xC008, 0xC000, 0x0027),  # operation enabled, does not follow
)

CONTROL = (
    # command, S-0-0134
    (0x02, 0x4000),  # quick stop: drive off, it brakes
    (0x07, 0x4000),  # disable operation: the same
    (0x0F, 0xE000),  # enable operation: drive on, enable, restart
)  # other commands: 0, no torque

cdef enum:
    ENABLED_BUT_OFF = 0x4000  # bit 14 stays, so that the drive brakes

cdef uint16_t[16] STATUS_OF    # by bits 15, 14, 13 and 3
cdef uint16_t[16] CONTROL_OF   # by bits 0 to 3 of the command


cdef uint16_t sercos_status(uint16_t status) noexcept nogil:
    """Return the statusword for S-0-0135."""
    return STATUS_OF[(status >> 12 & 0x0E) | (status >> 3 & 1)]


cdef uint16_t sercos_control(uint16_t command, bint reacts) noexcept nogil:
    """Return S-0-0134 for a controlword. `reacts`: the drive brakes after a fault."""
    if reacts:
        return ENABLED_BUT_OFF
    return CONTROL_OF[command & 0x0F]


def statusword_of(int status):
    return sercos_status(<uint16_t>(status & 0xFFFF))


def control_word_of(int controlword, bint reacts=False):
    return sercos_control(<uint16_t>(controlword & 0xFFFF), reacts)


def _fill():
    for bits in range(16):
        word = (bits & 0x0E) << 12 | (bits & 1) << 3
        for mask, value, statusword in reversed(STATUS):  # the first match has priority
            if word & mask == value:
                STATUS_OF[bits] = statusword
    for command, control in CONTROL:
        CONTROL_OF[command] = control


_fill()
