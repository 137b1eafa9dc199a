"""Fault injector for a link: loses, delays, duplicates or corrupts frames, deterministically.

Received frames that are not lost, and sent frames that are delayed, pass through one store in the
order of their due times. The faults of a frame are selected once, when it enters. The cost is two
copies of each received frame.
"""

from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t
from libc.string cimport memcpy, memset

from catenary.link._table cimport CAT_FRAME_MAX, WrapperLink, cat_link

from catenary.link.fault import DIRECTIONS, KINDS, TRAFFICS

cdef extern from "atomics.h" nogil:
    uint32_t cat_load_acquire32(const uint32_t *p)
    uint64_t cat_load_relaxed64(const uint64_t *p)
    void cat_store_release32(uint32_t *p, uint32_t v)
    void cat_store_release64(uint64_t *p, uint64_t v)

cdef enum:                            # positions in fault.KINDS, DIRECTIONS, TRAFFICS
    LOSE = 0
    DELAY = 1
    DUPLICATE = 2
    CORRUPT = 3
    KIND_COUNT = 4
    SENT = 0
    RECEIVED = 1
    ALL = 0
    CYCLIC = 1
    ACYCLIC = 2

cdef enum:
    MAX_RULES = 32
    MAX_HELD = 64                     # frames in flight; further ones are lost and counted as lost
    TAKEN_AT_ONCE = 256               # frames per call, so that a flood cannot delay the cycle
    ETHERNET_HEADER = 14
    FIRST_INDEX = 17                  # offset of the first datagram's index in the frame
    FIRST_ACYCLIC_INDEX = 0x80

cdef int64_t NEVER = 0x7FFFFFFFFFFFFFFF

ctypedef struct rule:
    int kind
    int direction
    int traffic
    int offset                        # -1: anywhere
    bint always
    uint64_t below                    # a random number below this selects the frame
    int64_t start                     # first affected frame number; then stop and step of the range
    int64_t stop
    int64_t step
    int64_t delay_ns

ctypedef struct rule_table:
    uint32_t count
    rule rules[MAX_RULES]

ctypedef struct held_frame:
    bint used
    int direction
    uint32_t length
    int64_t due
    uint64_t order                    # order of frames that are due at the same time
    uint8_t bytes[CAT_FRAME_MAX]

ctypedef struct verdict:
    bint lose
    bint duplicate
    bint corrupt
    int offset
    int64_t delay_ns

ctypedef struct injector_state:
    cat_link *inner
    uint64_t random
    uint64_t order
    uint32_t active                   # index of the valid table; `inject` writes the other one
    rule_table tables[2]
    int64_t seen[2][3]                # number of frames, by direction and traffic
    uint64_t injected[KIND_COUNT]
    held_frame held[MAX_HELD]
    uint8_t out[CAT_FRAME_MAX]


cdef uint64_t draw(injector_state *injector) noexcept nogil:
    """Return a random number by splitmix64 (Steele, Lea, Flood 2014)."""
    cdef uint64_t z
    injector.random += <uint64_t> 0x9E3779B97F4A7C15
    z = injector.random
    z = (z ^ (z >> 30)) * <uint64_t> 0xBF58476D1CE4E5B9
    z = (z ^ (z >> 27)) * <uint64_t> 0x94D049BB133111EB
    return z ^ (z >> 31)


cdef bint hits(injector_state *injector, const rule *fault, const int64_t *numbers) noexcept nogil:
    cdef int64_t number = numbers[fault.traffic]
    if number < fault.start or number >= fault.stop:
        return False
    if (number - fault.start) % fault.step != 0:
        return False
    return fault.always or draw(injector) < fault.below


cdef verdict judge(
    injector_state *injector, int direction, const uint8_t *frame, uint32_t length
) noexcept nogil:
    """Number the frame, and select and count its faults."""
    cdef verdict result
    cdef int64_t numbers[3]
    cdef rule_table *table = &injector.tables[cat_load_acquire32(&injector.active) & 1]
    cdef rule *fault
    cdef uint32_t i
    cdef int traffic = CYCLIC
    if length > FIRST_INDEX and frame[FIRST_INDEX] >= FIRST_ACYCLIC_INDEX:
        traffic = ACYCLIC
    memset(&result, 0, sizeof(result))
    numbers[ALL] = injector.seen[direction][ALL]
    numbers[CYCLIC] = numbers[ACYCLIC] = -1
    numbers[traffic] = injector.seen[direction][traffic]
    injector.seen[direction][ALL] += 1
    injector.seen[direction][traffic] += 1
    for i in range(min(table.count, <uint32_t> MAX_RULES)):
        fault = &table.rules[i]
        if fault.direction != direction or not hits(injector, fault, numbers):
            continue
        injector.injected[fault.kind] += 1
        if fault.kind == LOSE:
            result.lose = True
        elif fault.kind == DUPLICATE:
            result.duplicate = True
        elif fault.kind == DELAY:
            result.delay_ns += fault.delay_ns
        else:
            result.corrupt = True
            result.offset = fault.offset
    return result


cdef void corrupt(
    injector_state *injector, uint8_t *frame, uint32_t length, int offset
) noexcept nogil:
    cdef uint32_t size
    cdef uint64_t number
    if offset >= 0:
        if <uint32_t> offset < length:
            frame[offset] ^= 0xFF
        return
    if length < ETHERNET_HEADER + 2:
        return
    size = 2 + (frame[ETHERNET_HEADER] | (frame[ETHERNET_HEADER + 1] & 7) << 8)
    size = min(size, length - ETHERNET_HEADER)
    number = draw(injector)
    frame[ETHERNET_HEADER + (number >> 3) % size] ^= <uint8_t> (1 << (number & 7))


cdef void hold(
    injector_state *injector, int direction, const uint8_t *frame, uint32_t length, int64_t due
) noexcept nogil:
    cdef int i
    cdef held_frame *slot
    for i in range(MAX_HELD):
        slot = &injector.held[i]
        if not slot.used:
            slot.used = True
            slot.direction = direction
            slot.length = length
            slot.due = due
            slot.order = injector.order
            injector.order += 1
            memcpy(slot.bytes, frame, length)
            return
    injector.injected[LOSE] += 1


cdef inline bint is_before(const held_frame *a, const held_frame *b) noexcept nogil:
    return a.due < b.due or (a.due == b.due and a.order < b.order)


cdef held_frame *earliest(injector_state *injector, int direction) noexcept nogil:
    cdef held_frame *best = NULL
    cdef held_frame *slot
    cdef int i
    for i in range(MAX_HELD):
        slot = &injector.held[i]
        if not slot.used or slot.direction != direction:
            continue
        if best == NULL or is_before(slot, best):
            best = slot
    return best


cdef int enter(
    injector_state *injector, int direction, const uint8_t *frame, uint32_t length
) noexcept nogil:
    """Apply the faults of a frame: drop, send, or store it until it is due. Return 0 or -errno."""
    cdef verdict result = judge(injector, direction, frame, length)
    cdef int64_t now
    cdef int copies = 2 if result.duplicate else 1
    cdef uint8_t damaged[CAT_FRAME_MAX]
    cdef int status
    if result.lose:
        return 0
    if result.corrupt:
        memcpy(damaged, frame, length)
        corrupt(injector, damaged, length, result.offset)
        frame = damaged
    now = injector.inner.now(injector.inner.self)
    while copies > 0:
        copies -= 1
        if direction == RECEIVED or result.delay_ns > 0:
            hold(injector, direction, frame, length, now + result.delay_ns)
            continue
        status = injector.inner.send(injector.inner.self, frame, length)
        if status < 0:
            return status
    return 0


cdef void send_due(injector_state *injector) noexcept nogil:
    cdef int64_t now = injector.inner.now(injector.inner.self)
    cdef held_frame *slot = earliest(injector, SENT)
    while slot != NULL and slot.due <= now:
        injector.inner.send(injector.inner.self, slot.bytes, slot.length)
        slot.used = False
        slot = earliest(injector, SENT)


cdef int take_in(injector_state *injector) noexcept nogil:
    """Receive frames from the inner link and store those that are not lost. Return 0 or -errno."""
    cdef const uint8_t *frame = NULL
    cdef int k, length
    for k in range(TAKEN_AT_ONCE):
        length = injector.inner.receive(injector.inner.self, &frame)
        if length <= 0:
            return length
        if <uint32_t> length <= CAT_FRAME_MAX:
            enter(injector, RECEIVED, frame, <uint32_t> length)
    return 0


cdef int injector_send(void *self, const uint8_t *frame, uint32_t length) noexcept nogil:
    cdef injector_state *injector = <injector_state *> self
    send_due(injector)
    if length > CAT_FRAME_MAX:
        return injector.inner.send(injector.inner.self, frame, length)  # the inner link refuses it
    return enter(injector, SENT, frame, length)


cdef int injector_receive(void *self, const uint8_t **frame) noexcept nogil:
    cdef injector_state *injector = <injector_state *> self
    cdef held_frame *slot
    cdef int status
    send_due(injector)
    status = take_in(injector)
    if status < 0:
        return status
    slot = earliest(injector, RECEIVED)
    if slot == NULL or slot.due > injector.inner.now(injector.inner.self):
        return 0
    memcpy(injector.out, slot.bytes, slot.length)
    slot.used = False
    frame[0] = injector.out
    return <int> slot.length


cdef int64_t injector_now(void *self) noexcept nogil:
    cdef injector_state *injector = <injector_state *> self
    return injector.inner.now(injector.inner.self)


cdef int64_t due_of(const held_frame *slot) noexcept nogil:
    return NEVER if slot == NULL else slot.due


cdef int injector_wait_until(void *self, int64_t deadline, int wake_on_frame) noexcept nogil:
    """Wait like the inner link. Process delayed frames when they are due; ignore lost ones."""
    cdef injector_state *injector = <injector_state *> self
    cdef int64_t arrival, until
    cdef int status
    while True:
        send_due(injector)
        arrival = NEVER
        if wake_on_frame:
            status = take_in(injector)
            if status < 0:
                return status
            arrival = due_of(earliest(injector, RECEIVED))
            if arrival <= injector.inner.now(injector.inner.self):
                return 1
        until = min(deadline, arrival, due_of(earliest(injector, SENT)))
        status = injector.inner.wait_until(injector.inner.self, until, wake_on_frame)
        if status < 0 or (status == 0 and until == deadline):
            return status
        if injector.inner.now(injector.inner.self) > deadline:
            return 0                  # the deadline passed while lost frames kept arriving


cdef class FaultInjector(WrapperLink):
    """Wrapper that injects faults into `link`. The same seed and frames give the same faults."""
    cdef injector_state injector

    def __init__(self, link, *faults, seed=0):
        self.wrap(link)
        self.injector.inner = self.inner
        self.injector.random = <uint64_t> (seed & 0xFFFFFFFFFFFFFFFF)
        self.inject(*faults)
        self.table.self = &self.injector
        self.table.send = injector_send
        self.table.receive = injector_receive
        self.table.now = injector_now
        self.table.wait_until = injector_wait_until

    def inject(self, *faults):
        """Replace all faults, even during operation. Without arguments, remove all faults.

        The frame numbers continue.

        Raises:
            ValueError: There are more than 32 faults.
        """
        if len(faults) > MAX_RULES:
            raise ValueError(f"cannot inject {len(faults)} faults, at most {MAX_RULES}")
        cdef uint32_t other = 1 - (self.injector.active & 1)
        cdef rule_table *table = &self.injector.tables[other]
        for i, fault in enumerate(faults):
            write_rule(&table.rules[i], fault)
        table.count = <uint32_t> len(faults)
        cat_store_release32(&self.injector.active, other)

    def seen(self, direction="received", *, traffic="all"):
        """Return the number of frames so far in this direction and traffic."""
        return self.injector.seen[DIRECTIONS.index(direction)][TRAFFICS.index(traffic)]

    @property
    def injected(self):
        """Number of injected faults, by kind; "lose" includes frames lost in a full store."""
        return {kind: self.injector.injected[i] for i, kind in enumerate(KINDS)}


cdef int write_rule(rule *target, fault) except -1:
    frames = range(0, 2**62) if fault.frames is None else fault.frames
    target.kind = KINDS.index(fault.kind)
    target.direction = DIRECTIONS.index(fault.direction)
    target.traffic = TRAFFICS.index(fault.traffic)
    target.offset = -1 if fault.offset is None else fault.offset
    target.always = fault.probability >= 1.0
    target.below = <uint64_t> min(int(fault.probability * 2.0**64), 2**64 - 1)
    target.start = frames.start
    target.stop = frames.stop
    target.step = frames.step
    target.delay_ns = round(fault.delay * 1e9)
    return 0
