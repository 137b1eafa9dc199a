"""Wires of a segment: cables, routes of frames, frame faults, and lost frames."""

from libc.stdint cimport int64_t, uint32_t, uint64_t

from catenary.virtual._segment cimport (
    LOSS_LOG,
    MAX_FRAME_FAULTS,
    PORTS,
    Core,
    cable,
    cable_end,
    cable_lay,
    frame_fault,
    lock,
    loss,
    monotonic_now,
    route,
    routes_refresh,
    segment_advance,
    segment_light,
    unlock,
)

FRAME_FAULTS_MAX = MAX_FRAME_FAULTS


cdef class Wires:
    """View of the cables of `core`; it owns nothing."""

    cdef Core _core

    def __init__(self, Core core):
        self._core = core

    def lay_cable(self, int n, tuple up, tuple down):
        """Connect cable n to two (device, port); devices -1 and -2 are the MainDevice's
        interfaces."""
        cdef cable_end above, below
        above.device, above.port = up
        below.device, below.port = down
        for end in (above, below):
            if not (0 <= n < self._core._segment.cable_count and -2 <= end.device < self._core.count
                    and 0 <= end.port < PORTS):
                raise ValueError(f"impossible cable {n}")
        lock(self._core._segment)
        cable_lay(self._core._segment, n, above, below)
        unlock(self._core._segment)

    cdef cable *_cable(self, int n) except NULL:
        if not 0 <= n < self._core._segment.cable_count:
            raise IndexError(f"no cable {n}")
        return &self._core._segment.cables[n]

    def plug_cable(self, int n, bint plugged, bint at_once=False):
        """Plug or unplug a cable. `at_once`: without the controllers' detection time."""
        cdef cable *k = self._cable(n)
        lock(self._core._segment)
        if not self._core._segment.is_virtual:
            segment_advance(self._core._segment, monotonic_now())
        k.plugged = plugged
        segment_light(self._core._segment, at_once)
        unlock(self._core._segment)

    def raise_end(self, int end, bint up):
        """Switch an interface of the MainDevice on or off, like a network card."""
        if not 0 <= end <= self._core._segment.ring:
            raise IndexError(f"no end {end}")
        lock(self._core._segment)
        self._core._segment.ends[end].up = up
        segment_light(self._core._segment, True)
        unlock(self._core._segment)

    def cable_light(self, int n):
        return bool(self._cable(n).light)

    def delay_cable(self, int n, int64_t delay_ns):
        """Set the delay of a cable, one way."""
        lock(self._core._segment)
        self._cable(n).delay = delay_ns
        segment_light(self._core._segment, False)
        unlock(self._core._segment)

    def processed(self, int end):
        """Return the positions of the devices that process a frame from an interface, in order."""
        cdef uint32_t k
        cdef route *r = &self._core._segment.routes[end]
        lock(self._core._segment)
        routes_refresh(self._core._segment)
        positions = [r.stops[k].controller - self._core._segment.controllers
                     for k in range(r.stop_count)]
        unlock(self._core._segment)
        return positions

    # -- faults that hit frames -----------------------------------------------------------------

    def add_frame_fault(self, int kind, *, int64_t frames, uint32_t every, int64_t delay_ns,
                        int cable, int offset):
        """Add a fault and return its number. `frames` -1: unlimited. Kinds are in frame_faults.h's
        order."""
        cdef int n
        cdef frame_fault *f
        for n in range(MAX_FRAME_FAULTS):
            f = &self._core._segment.faults[n]
            if f.used:
                continue
            lock(self._core._segment)
            f.kind, f.left, f.every, f.delay = kind, frames, every, delay_ns
            f.cable, f.offset, f.seen, f.used = cable, offset, 0, 1
            self._core._segment.fault_count += 1
            unlock(self._core._segment)
            return n
        raise ValueError(f"at most {MAX_FRAME_FAULTS} faults can hit frames at a time")

    def frame_fault_left(self, int n):
        return self._core._segment.faults[n].left if self._core._segment.faults[n].used else 0

    def remove_frame_fault(self, int n):
        lock(self._core._segment)
        if self._core._segment.faults[n].used:
            self._core._segment.faults[n].used = 0
            self._core._segment.fault_count -= 1
        unlock(self._core._segment)

    def losses(self, uint64_t since):
        """Return [(sent [ns], cause, interface)] of the frames lost from number `since` on, as far
        as the log (LOSS_LOG) goes back, and the total number of lost frames.
        """
        cdef uint64_t k
        cdef loss *x
        lock(self._core._segment)
        total = self._core._segment.loss_count
        first = max(since, total - min(total, <uint64_t>LOSS_LOG))
        found = []
        for k in range(first, total):
            x = &self._core._segment.losses[k % <uint64_t>LOSS_LOG]
            found.append((x.sent, x.cause, x.end))
        unlock(self._core._segment)
        return found, total
