"""Ring of devices on two links: every frame is sent on both links and delivered once.

In a closed ring, all devices process the copy sent on the first link, which arrives on the second.
No device processes the other copy. In a cut ring, both copies turn back at the cut and return on the
link on which they were sent. In both cases, the receiver gets one frame (native/ring_merge.h).

After one copy has arrived, the ring waits `pair_wait` for the other. It does not wait if the other
copy was missing three times in a row, unless a broadcast has reached fewer devices than before. A
copy that no device has processed is not delivered alone. The cost is a few copies of each frame and
two system calls per send.
"""

from libc.errno cimport EINTR, EMSGSIZE, errno
from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t
from libc.string cimport memcmp, memcpy
from posix.time cimport timespec

from catenary.link._table cimport (
    CAT_FRAME_MAX,
    CAT_LINK_FORETELLS,
    CAT_LINK_POLLS,
    CAT_LINK_SHARED_TIME,
    CAT_LINK_VIRTUAL_TIME,
    TableLink,
    cat_link,
    table_of,
)

from catenary.link._table import explained_by
from catenary.link.protocol import open_link
from catenary.link.ring_state import ROUTES, RingState

cdef extern from "locked_memory.h" nogil:
    ctypedef struct cat_memory:
        pass
    void *cat_memory_take(cat_memory *memory, size_t count, size_t size)
    void cat_memory_settle(cat_memory *memory)
    void cat_memory_free(cat_memory *memory)

cdef extern from "ring_merge.h" nogil:
    int cat_ring_merge(uint8_t *frame, uint32_t length, const uint8_t *other, uint32_t other_length)
    void cat_ring_second(uint8_t *frame, uint32_t length)
    uint32_t cat_find_nop(const uint8_t *frame, uint32_t length, uint32_t *size)

cdef extern from "ethercat.h" nogil:
    enum:
        CAT_BRD
        CAT_DATAGRAM_COUNTER
        CAT_DATAGRAM_HEADER
        CAT_ETHERCAT_HEADER
        CAT_ETHERNET_HEADER

cdef extern from "<poll.h>" nogil:
    enum:
        POLLIN
    struct pollfd:
        int fd
        short events
        short revents
    int ppoll(pollfd *fds, unsigned long count, const timespec *timeout, const void *mask)

cdef enum:
    FIRST = 0
    SECOND = 1
    BOTH = 2
    SLOTS = 256                       # one for each index of a datagram
    MARK = 11                         # last byte of the source address: identifies the copy
    SECOND_BIT = 0x80
    SOURCE = 6
    PROCESSED = 0x02                  # bit of the first source address byte, set by a controller
    DATAGRAMS = CAT_ETHERNET_HEADER + CAT_ETHERCAT_HEADER
    INDEX = DATAGRAMS + 1             # offset of the first datagram's index
    HEADERS = DATAGRAMS + CAT_DATAGRAM_HEADER + CAT_DATAGRAM_COUNTER  # smallest frame
    GIVEN_UP = 3                      # consecutive missing copies until a copy is given up
    BURST = 512                       # largest number of frames received per call
    SECOND_NS = 1_000_000_000

cdef int64_t NEVER = 0x7FFFFFFFFFFFFFFF

ctypedef struct slot_t:
    uint32_t length
    uint32_t nop                      # offset of the data of a NOP; 0 without a NOP
    uint32_t nop_size
    uint8_t expected                  # copies sent: bit 0 first, bit 1 second
    uint8_t back                      # copies that returned
    uint8_t delivered
    int64_t since                     # time at which the first copy returned [ns]
    uint64_t order                    # order of completion
    uint8_t sent[CAT_FRAME_MAX]
    uint8_t copies[2][CAT_FRAME_MAX]

ctypedef struct ring_t:
    cat_link *links[2]
    int route                         # links on which frames are sent: FIRST, SECOND or BOTH
    int64_t pair_wait
    uint32_t missed[2]                # consecutive missing copies
    uint32_t waiting                  # slots with a copy that is not delivered
    uint32_t arrived_on[2]            # link on which the last copy returned; BOTH: none yet
    uint32_t counted[2]               # devices that answered the last broadcast of each copy
    uint32_t total                    # devices that answered the last broadcast that was delivered
    uint64_t unpaired                 # frames delivered from one copy: the other was late or lost
    uint64_t alien                    # frames of other senders, late or repeated frames
    uint64_t send_errors[2]
    uint8_t pending[SLOTS]            # indices with a copy, in no order
    slot_t *slots
    uint8_t out[CAT_FRAME_MAX]        # lent to the receiver
    uint8_t second[CAT_FRAME_MAX]     # the copy that is being sent


cdef inline int64_t ring_now(void *self) noexcept nogil:
    cdef ring_t *ring = <ring_t *> self
    return ring.links[0].now(ring.links[0].self)


cdef void forget(ring_t *ring, uint8_t index) noexcept nogil:
    """Remove an index from the pending indices."""
    cdef uint32_t i
    for i in range(ring.waiting):
        if ring.pending[i] == index:
            ring.waiting -= 1
            ring.pending[i] = ring.pending[ring.waiting]
            return


cdef inline void note_missed(ring_t *ring, int side) noexcept nogil:
    if ring.missed[side] < GIVEN_UP:
        ring.missed[side] += 1


cdef int ring_send(void *self, const uint8_t *frame, uint32_t length) noexcept nogil:
    cdef ring_t *ring = <ring_t *> self
    cdef slot_t *slot
    cdef const uint8_t *copy
    cdef int status, worst = 0, side
    if length > CAT_FRAME_MAX:
        return -EMSGSIZE
    if length < HEADERS:
        return ring.links[0].send(ring.links[0].self, frame, length)
    slot = &ring.slots[frame[INDEX]]
    forget(ring, frame[INDEX])
    slot.length = length
    slot.nop = cat_find_nop(frame, length, &slot.nop_size)
    slot.back = 0
    slot.delivered = 0
    slot.expected = 0
    memcpy(slot.sent, frame, length)
    memcpy(ring.second, frame, length)
    ring.second[MARK] |= SECOND_BIT
    if ring.route == BOTH:
        cat_ring_second(ring.second, length)
    for side in range(2):
        if ring.route != BOTH and ring.route != side:
            continue
        copy = slot.sent
        if side == SECOND:
            copy = ring.second
        status = ring.links[side].send(ring.links[side].self, copy, length)
        if status < 0:
            ring.send_errors[side] += 1
            note_missed(ring, side)   # a port without a carrier refuses frames, so no copy returns
            worst = status
        else:
            slot.expected |= 1 << side
    return 0 if slot.expected else worst


cdef void take_in(ring_t *ring) noexcept nogil:
    """Receive the frames that have returned on either link, and store their copies."""
    cdef const uint8_t *frame = NULL
    cdef int arrived, length, k
    for arrived in range(2):
        for k in range(BURST):
            length = ring.links[arrived].receive(ring.links[arrived].self, &frame)
            if length <= 0:
                break
            take(ring, arrived, frame, <uint32_t> length)


cdef void take(ring_t *ring, int arrived, const uint8_t *frame, uint32_t length) noexcept nogil:
    cdef slot_t *slot
    cdef int side
    if length < HEADERS or length > CAT_FRAME_MAX:
        ring.alien += 1
        return
    slot = &ring.slots[frame[INDEX]]
    side = SECOND if frame[MARK] & SECOND_BIT else FIRST
    if not slot.expected >> side & 1 or slot.back >> side & 1 or not is_copy(slot, frame, length):
        ring.alien += 1
        return
    slot.back |= 1 << side
    ring.missed[side] = 0
    ring.arrived_on[side] = arrived
    if frame[16] == CAT_BRD:
        ring.counted[side] = first_counter(frame, length)
    if slot.delivered:
        return
    memcpy(slot.copies[side], frame, min(length, slot.length))  # padding may be cut off
    slot.copies[side][MARK] &= ~SECOND_BIT
    if slot.back == 1 << side:
        slot.since = ring_now(ring)
        ring.pending[ring.waiting] = frame[INDEX]
        ring.waiting += 1


cdef bint is_copy(const slot_t *slot, const uint8_t *frame, uint32_t length) noexcept nogil:
    """Return True if the frame has the EtherCAT header and the NOP of the sent frame.

    The NOP contains the cycle number, which identifies late frames (core/_frames.pyx).
    """
    if length < DATAGRAMS + <uint32_t> (frame[14] | (frame[15] & 7) << 8):
        return False
    if frame[14] != slot.sent[14] or frame[15] != slot.sent[15]:
        return False
    return slot.nop == 0 or memcmp(frame + slot.nop, slot.sent + slot.nop, slot.nop_size) == 0


cdef uint32_t first_counter(const uint8_t *frame, uint32_t length) noexcept nogil:
    cdef uint32_t at = 26 + ((frame[22] | frame[23] << 8) & 0x7FF)
    return frame[at] | frame[at + 1] << 8 if at + 2 <= length else 0


cdef inline bint is_processed(const uint8_t *frame) noexcept nogil:
    return frame[SOURCE] & PROCESSED != 0


cdef inline bint lacks_devices(ring_t *ring, const slot_t *slot, int side) noexcept nogil:
    """Return True for a broadcast that reached fewer devices than the previous one (cut ring)."""
    return slot.sent[16] == CAT_BRD and first_counter(slot.copies[side], slot.length) < ring.total


cdef int64_t due_at(ring_t *ring, const slot_t *slot) noexcept nogil:
    """Return the time at which a returned frame is delivered [ns]; NEVER: only with its other copy."""
    cdef int missing
    if slot.back == slot.expected:
        return slot.since
    missing = SECOND if slot.back == 1 else FIRST
    if not is_processed(slot.copies[1 - missing]) and not is_processed(slot.sent):
        return NEVER                  # no device has processed this copy, so it contains no data
    if ring.missed[missing] >= GIVEN_UP and not lacks_devices(ring, slot, 1 - missing):
        return slot.since
    return slot.since + ring.pair_wait


cdef int next_due(ring_t *ring, int64_t *when) noexcept nogil:
    """Return the position in `pending` of the frame to deliver first; -1 if there is none.

    `when`: set to the time of its delivery [ns]; NEVER if there is none.
    """
    cdef int best = -1
    cdef uint32_t i
    cdef int64_t due
    when[0] = NEVER
    for i in range(ring.waiting):
        due = due_at(ring, &ring.slots[ring.pending[i]])
        if due < when[0]:
            when[0] = due
            best = <int> i
    return best


cdef int ring_receive(void *self, const uint8_t **frame) noexcept nogil:
    cdef ring_t *ring = <ring_t *> self
    cdef slot_t *slot
    cdef int64_t due
    cdef int place, side
    cdef bint whole
    take_in(ring)
    place = next_due(ring, &due)
    if place < 0 or due > ring_now(ring):
        return 0
    slot = &ring.slots[ring.pending[place]]
    ring.waiting -= 1
    ring.pending[place] = ring.pending[ring.waiting]
    slot.delivered = 1
    whole = slot.back == slot.expected
    if not whole:
        ring.unpaired += 1
        note_missed(ring, SECOND if slot.back == 1 else FIRST)
    if slot.sent[16] == CAT_BRD:
        ring.total = 0
        for side in range(2):
            if slot.back >> side & 1:
                ring.total += first_counter(slot.copies[side], slot.length)
    if slot.back & 1:
        memcpy(ring.out, slot.copies[FIRST], slot.length)
    else:
        memcpy(ring.out, slot.sent, slot.length)
        ring.out[SOURCE] = slot.copies[SECOND][SOURCE]
    if slot.back & 2:
        ring.out[SOURCE] |= slot.copies[SECOND][SOURCE] & PROCESSED
        cat_ring_merge(ring.out, slot.length, slot.copies[SECOND], slot.length)
    frame[0] = ring.out
    return <int> slot.length


cdef int ring_wait_until(void *self, int64_t deadline, int wake_on_frame) noexcept nogil:
    cdef ring_t *ring = <ring_t *> self
    cdef cat_link *first = ring.links[0]
    cdef int64_t due
    cdef int status
    if not wake_on_frame:
        return first.wait_until(first.self, deadline, 0)
    while True:
        take_in(ring)
        next_due(ring, &due)
        if due <= ring_now(ring):
            return 1
        status = wait_for_either(ring, min(deadline, due))
        if status < 0:
            return status
        if ring_now(ring) >= deadline:  # even if foreign frames keep arriving
            take_in(ring)
            next_due(ring, &due)
            return 1 if due <= ring_now(ring) else 0


cdef int wait_for_either(ring_t *ring, int64_t deadline) noexcept nogil:
    """Return 1 if a frame may have arrived, 0 at the deadline, or -errno."""
    cdef cat_link *a = ring.links[0]
    cdef cat_link *b = ring.links[1]
    cdef pollfd fds[2]
    cdef timespec rest
    cdef int64_t left, until
    cdef int ready
    if a.flags & CAT_LINK_FORETELLS:
        until = min(deadline, a.due(a.self), b.due(b.self))
        ready = a.wait_until(a.self, until, 0)
        return ready if ready < 0 else (1 if until < deadline else 0)
    left = max(deadline - ring_now(ring), <int64_t> 0)
    rest.tv_sec = left // SECOND_NS
    rest.tv_nsec = left % SECOND_NS
    fds[0].fd = a.fd
    fds[1].fd = b.fd
    fds[0].events = fds[1].events = POLLIN
    fds[0].revents = fds[1].revents = 0
    ready = ppoll(fds, 2, &rest, NULL)
    if ready < 0:
        return -errno
    if ready > 0 and not (fds[0].revents & POLLIN or fds[1].revents & POLLIN):
        # A NIC that went down reports an error until it is read; the other NIC keeps working.
        silence(a, &fds[0])
        silence(b, &fds[1])
    return 1 if ready > 0 else 0


cdef void silence(cat_link *link, const pollfd *fd) noexcept nogil:
    """Clear the error of a socket by a wait that has already expired."""
    if fd.revents and not fd.revents & POLLIN:
        link.wait_until(link.self, 0, 1)


cdef class RingLink(TableLink):
    """Owner of the two links of a ring.

    `pair_wait` is the maximum time to wait for the second copy of a frame after the first [s].

    Raises:
        ValueError: `pair_wait` is not from 0 to 1 s, or the two links cannot form a ring.
    """
    cdef ring_t ring
    cdef cat_memory memory            # the slots
    cdef readonly tuple links
    cdef tuple capsules

    def __init__(self, first, second, double pair_wait=100e-6):
        if not 0 <= pair_wait <= 1:
            raise ValueError(f"pair_wait={pair_wait} s: must be from 0 to 1 s")
        self.ring.slots = <slot_t *> cat_memory_take(&self.memory, SLOTS, sizeof(slot_t))
        if self.ring.slots == NULL:
            raise MemoryError
        self.open_both(first, second)
        self.ring.route = BOTH
        self.ring.pair_wait = round(pair_wait * 1e9)
        self.ring.arrived_on[0] = self.ring.arrived_on[1] = BOTH
        if not self.ring.links[0].flags & CAT_LINK_VIRTUAL_TIME:
            cat_memory_settle(&self.memory)
        self.table.self = &self.ring
        self.table.flags = self.ring.links[0].flags & (CAT_LINK_VIRTUAL_TIME | CAT_LINK_SHARED_TIME)
        self.table.send = ring_send
        self.table.receive = ring_receive
        self.table.now = ring_now
        self.table.wait_until = ring_wait_until

    cdef int open_both(self, first, second) except -1:
        opened = []
        try:
            for source in (first, second):
                opened.append(open_link(source))
            self.links = tuple(opened)
            self.capsules = tuple(link.capsule for link in opened)
            for side in range(2):
                self.ring.links[side] = table_of(self.capsules[side])
            self.name = ",".join(link.name for link in opened)
            self.check_kind()
        except BaseException:
            for link in opened:
                link.close()
            raise
        return 0

    cdef int check_kind(self) except -1:
        cdef uint32_t wanted = CAT_LINK_POLLS | CAT_LINK_FORETELLS
        cdef uint32_t both = self.ring.links[0].flags & self.ring.links[1].flags & wanted
        if both == 0:
            raise ValueError(
                f"{self.name}: a ring needs two network interfaces, or the two ends of one virtual"
                " segment; wrap recorders and fault injectors around the ring"
            )
        return 0

    @property
    def route(self):
        """Links on which frames are sent: "both", "first" or "second"."""
        return ROUTES[self.ring.route]

    @route.setter
    def route(self, str value not None):
        if value not in ROUTES:
            raise ValueError(f"route {value!r}: must be one of {', '.join(ROUTES)}")
        self.ring.route = ROUTES.index(value)

    @property
    def state(self):
        """State of the ring, derived from the last frames."""
        return RingState.of(
            [self.ring.arrived_on[side] for side in range(2)],
            [self.ring.missed[side] >= GIVEN_UP for side in range(2)],
            [self.ring.counted[side] for side in range(2)],
        )

    @property
    def counts(self):
        """Counts: unpaired frames (a copy was late or lost), alien frames, send errors per link."""
        return {
            "unpaired": self.ring.unpaired,
            "alien": self.ring.alien,
            "send_errors_first": self.ring.send_errors[0],
            "send_errors_second": self.ring.send_errors[1],
        }

    def explain(self, int number):
        for link in self.links:
            explained = explained_by(link, number)
            if explained is not None:
                return explained
        return None

    cdef int close_table(self) except -1:
        try:
            self.links[0].close()
        finally:
            self.links[1].close()
        return 0

    def __dealloc__(self):
        cat_memory_free(&self.memory)


def merge(bytes first not None, bytes second not None):
    """Return one frame, merged from two copies.

    Raises:
        ValueError: The arguments are not copies of the same frame.
    """
    cdef bytearray merged = bytearray(first)
    cdef uint8_t *out = merged
    if cat_ring_merge(out, <uint32_t> len(first), <const uint8_t *> second, <uint32_t> len(second)):
        raise ValueError("the arguments are not two copies of one frame")
    return bytes(merged)


def second_copy(bytes frame not None):
    """Return the copy of a frame that is sent on the second link."""
    cdef bytearray copy = bytearray(frame)
    cdef uint8_t *out = copy
    cat_ring_second(out, <uint32_t> len(frame))
    return bytes(copy)
