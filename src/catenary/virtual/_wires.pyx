"""Wires of a segment: cables, routes of frames, frame faults and lost frames."""

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
    """View of the cables of `core`, which owns them."""

    cdef Core _core

    def __init__(self, Core core):
        self._core = core

    def lay_cable(self, int n, tuple up, tuple down):
        """Connect cable n.

        Args:
            n: Number of the cable.
            up: (device, port) of the end closer to the first interface of the MainDevice. Devices
                -1 and -2 are the interfaces of the MainDevice.
            down: (device, port) of the other end.

        Raises:
            ValueError: The cable, a device or a port does not exist.
        """
        cdef cable_end above, below
        above.device, above.port = up
        below.device, below.port = down
        for end in (above, below):
            if not (0 <= n < self._core._segment.cable_count and -2 <= end.device < self._core.count
                    and 0 <= end.port < PORTS):
                raise ValueError(f"invalid cable {n}: no such number, device or port ({up}, {down})")
        lock(self._core._segment)
        cable_lay(self._core._segment, n, above, below)
        unlock(self._core._segment)

    cdef cable *_cable(self, int n) except NULL:
        if not 0 <= n < self._core._segment.cable_count:
            raise IndexError(f"the segment has no cable {n}")
        return &self._core._segment.cables[n]

    def plug_cable(self, int n, bint plugged, bint at_once=False):
        """Plug or unplug a cable. `at_once`: skip the detection time of the controllers."""
        cdef cable *k = self._cable(n)
        lock(self._core._segment)
        if not self._core._segment.is_virtual:
            segment_advance(self._core._segment, monotonic_now())
        k.plugged = plugged
        segment_light(self._core._segment, at_once)
        unlock(self._core._segment)

    def raise_end(self, int end, bint up):
        """Activate or deactivate an interface of the MainDevice, and thus its light."""
        if not 0 <= end <= self._core._segment.ring:
            raise IndexError(f"the segment has no end {end}")
        lock(self._core._segment)
        self._core._segment.ends[end].up = up
        segment_light(self._core._segment, True)
        unlock(self._core._segment)

    def cable_light(self, int n):
        return bool(self._cable(n).light)

    def delay_cable(self, int n, int64_t delay_ns):
        """Set the one-way delay of a cable [ns]."""
        cdef cable *k = self._cable(n)  # raises before the lock is taken
        lock(self._core._segment)
        k.delay = delay_ns
        segment_light(self._core._segment, False)
        unlock(self._core._segment)

    def processed(self, int end):
        """Return the positions of the devices that process frames of one interface, in order."""
        cdef uint32_t k
        cdef route *r = &self._core._segment.routes[end]
        lock(self._core._segment)
        routes_refresh(self._core._segment)
        positions = [r.stops[k].controller - self._core._segment.controllers
                     for k in range(r.stop_count)]
        unlock(self._core._segment)
        return positions

    # -- frame faults ---------------------------------------------------------------------------

    def add_frame_fault(self, int kind, *, int64_t frames, uint32_t every, int64_t delay_ns,
                        int cable, int offset):
        """Add a frame fault and return its number.

        Args:
            kind: `frame_fault_kind` (frame_faults.h).
            frames: Number of frames to affect; -1: unlimited.
            every: Interval in frames; 1: every frame.
            delay_ns: Delay of FAULT_DELAY [ns].
            cable: Cable of FAULT_CORRUPT.
            offset: Offset of the byte for FAULT_GARBLE; -1: a random bit.

        Raises:
            ValueError: The maximum number of faults is active.
        """
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
        raise ValueError(f"at most {MAX_FRAME_FAULTS} frame faults can be active at once")

    def frame_fault_left(self, int n):
        return self._core._segment.faults[n].left if self._core._segment.faults[n].used else 0

    def remove_frame_fault(self, int n):
        lock(self._core._segment)
        if self._core._segment.faults[n].used:
            self._core._segment.faults[n].used = 0
            self._core._segment.fault_count -= 1
        unlock(self._core._segment)

    def losses(self, uint64_t since):
        """Return the lost frames from number `since` on, and the total number of lost frames.

        Each lost frame is (time of sending [ns], cause, interface). The log keeps LOSS_LOG frames.
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
