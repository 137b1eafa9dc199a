"""Application side of SyncManagers: mailboxes, buffers, and their activation by the PDI."""

from cpython.bytes cimport PyBytes_FromStringAndSize
from libc.stdint cimport uint8_t

from catenary.virtual._segment cimport (
    SM_ACTIVATE_REPEAT,
    SM_PDI_DEACTIVATE,
    SM_PDI_REPEAT_ACK,
    Core,
    cat_segment,
    controller,
    lock,
    sm_configured,
    sm_pdi_read,
    sm_pdi_write,
    sm_registers,
    sync_manager,
    unlock,
)


cdef class Buffers:
    """SyncManagers of all controllers. `position`: the device; `n`: number of the SyncManager.

    Methods raise IndexError if the device or the SyncManager does not exist.
    """

    cdef Core _core
    cdef cat_segment *_segment

    def __init__(self, Core core not None):
        self._core, self._segment = core, core._segment

    def settings(self, int position, int n):
        """Return (start, length, control, enabled, full)."""
        cdef sync_manager *sm = self._core._sync_manager_at(position, n)
        cdef controller *c = self._core._at(position)
        return sm.start, sm.length, sm_registers(c, n)[4], bool(sm.enabled), bool(sm.full)

    def block(self, int position, int n, bint blocked):
        """Block or release a SyncManager from the PDI side. A blocked one refuses all access.

        A change empties the buffers.
        """
        cdef controller *c = self._core._at(position)
        cdef uint8_t *r
        self._core._sync_manager_at(position, n)
        lock(self._segment)
        r = sm_registers(c, n)
        r[7] = (r[7] & ~SM_PDI_DEACTIVATE) | (SM_PDI_DEACTIVATE if blocked else 0)
        sm_configured(c, n)
        unlock(self._segment)

    def acknowledge_repeat(self, int position, int n):
        """Acknowledge a repeat request, after the last answer was put into the mailbox again."""
        cdef controller *c = self._core._at(position)
        cdef uint8_t *r
        self._core._sync_manager_at(position, n)
        lock(self._segment)
        r = sm_registers(c, n)
        r[7] = (r[7] & ~SM_PDI_REPEAT_ACK) | (r[6] & SM_ACTIVATE_REPEAT)
        unlock(self._segment)

    def read(self, int position, int n):
        """Return complete data from the MainDevice, or None. This empties a mailbox."""
        cdef uint8_t buffer[4096]
        cdef controller *c = self._core._at(position)
        cdef int size
        self._core._sync_manager_at(position, n)
        lock(self._segment)
        size = sm_pdi_read(c, n, buffer, 4096)
        unlock(self._segment)
        return None if size < 0 else PyBytes_FromStringAndSize(<char *>buffer, size)

    def write(self, int position, int n, bytes data):
        """Write a buffer. Return False if the mailbox is full or the SyncManager refuses access."""
        cdef controller *c = self._core._at(position)
        cdef int size
        self._core._sync_manager_at(position, n)
        lock(self._segment)
        size = sm_pdi_write(c, n, <const uint8_t *><const char *>data, len(data))
        unlock(self._segment)
        return size >= 0

    def take_back(self, int position, int n):
        """Remove and return an answer that the MainDevice has not read; None if there is none."""
        cdef controller *c = self._core._at(position)
        cdef sync_manager *sm = self._core._sync_manager_at(position, n)
        data = None
        lock(self._segment)
        if sm.enabled and sm.mailbox and sm.full:
            data = PyBytes_FromStringAndSize(<char *>c.memory + sm.start, sm.length)
            sm.full = 0
            sm_registers(c, n)[5] &= 0xF6
        unlock(self._segment)
        return data
