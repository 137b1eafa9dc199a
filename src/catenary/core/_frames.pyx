# cython: boundscheck=False, wraparound=False, cdivision=True
"""The frame engine: the image table (native/image.h) on a link (native/link.h), ETG.1000.4 §5.4.

Theory of operation
    The plan makes a template for each frame. `emit` advances `serial`, gives each due frame the
    next index, copies the outputs into the templates and sends them. `collect`
    takes received frames until all are back or the deadline has passed. Then it
    evaluates returned frames (`judge_frame`) and sync units (`judge_units`) once, and copies the
    inputs of valid units to the image. The inputs of other units keep their last valid values.

Matching
    A received frame is accepted if source, EtherType, commands, addresses and lengths match the
    template and its index was assigned in this cycle. An index is reused after 128 frames, so an
    old frame that returns exactly 128 frames later is accepted as well. Frames with a cycle number
    (a NOP datagram, `exact_matching` in the plan) are accepted only with the number of this cycle.
    Every other frame is counted by kind and dropped (`frame_counters_t`).

Validity
    A sync unit is valid if all of its datagrams are back with the expected working counter. `ok`
    and `whole` are the two results for the cycle; the fields are defined in _frames.pxd.

Budget for three drives in one frame: emit 0.2 us, collect 0.3 us, without the link.
"""

from cpython.pycapsule cimport PyCapsule_GetPointer, PyCapsule_IsValid
from libc.errno cimport EINTR
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcpy

from catenary.core._clocks cimport clock_emit, clock_t, clock_take
from catenary.core._acyclic_queue cimport acyclic_received
from catenary.core._memory cimport cat_memory, cat_memory_free, memory_take
from catenary.core._native cimport (
    CAT_AL_ERROR,
    CAT_AL_STATE,
    CAT_APRD,
    CAT_APRW,
    CAT_APWR,
    CAT_ARMW,
    CAT_BRD,
    CAT_BRW,
    CAT_BWR,
    CAT_DATAGRAM_COUNTER,
    CAT_DATAGRAM_HEADER,
    CAT_ETHERCAT_HEADER,
    CAT_ETHERNET_HEADER,
    CAT_FPRD,
    CAT_FPWR,
    CAT_FRAME_MAX,
    CAT_FRAME_MIN,
    CAT_FRMW,
    CAT_IMAGE_VERSION,
    CAT_LINK_CAPSULE,
    CAT_LINK_VERSION,
    CAT_LINK_VIRTUAL_TIME,
    CAT_NOP,
    cat_link,
)
from catenary.core._numbers cimport IMAGE_PADDING

cdef enum:
    SOURCE = 6                 # offset of the source address
    SOURCE_PROCESSED = 0x02    # set in its first byte by the first controller passed
    DATAGRAMS = CAT_ETHERNET_HEADER + CAT_ETHERCAT_HEADER
    HEADER = CAT_DATAGRAM_HEADER
    CYCLE_INDICES = 0x80       # indices from here on belong to the acyclic queue
    DRAIN_MAX = 256            # maximum per collect, so that a flood of frames cannot delay the cycle
    DIVIDER_MAX = 10000
    MISSED_MAX = 1000000000
    NUMBER_SIZE = 4            # size of the data of a cycle number [bytes]

cdef enum:                     # kinds of datagrams, as in plan/cycle.py
    PROCESS_DATA = 0
    AL_STATUS = 1
    CLOCK = 2
    CYCLE_NUMBER = 3

# Every device adds one to the position in the address (ETG.1000.4 §5.4.1).
ADDRESS_MOVES = frozenset(
    (CAT_APRD, CAT_APWR, CAT_APRW, CAT_BRD, CAT_BWR, CAT_BRW, CAT_ARMW)
)
RECEIVE_MODES = {"poll": POLL, "wait": WAIT, "busy": BUSY}


cdef inline uint16_t word_at(const uint8_t *bytes) noexcept nogil:
    return <uint16_t>(bytes[0] | (bytes[1] << 8))


cdef inline uint64_t eight_at(const uint8_t *bytes) noexcept nogil:
    cdef uint64_t word
    memcpy(&word, bytes, 8)
    return word


cdef inline uint16_t counter_of(const datagram_t *d, const uint8_t *frame) noexcept nogil:
    return word_at(frame + d.offset + HEADER + d.length)


cdef inline uint32_t number_in(const frame_t *frame, const uint8_t *bytes) noexcept nogil:
    """Return the cycle number of a frame that has one, in the byte order of this machine."""
    cdef uint32_t number
    memcpy(&number, bytes + frame.number_offset, NUMBER_SIZE)
    return number


# ---- emit

cdef inline void fill_outputs(frames_t *f, frame_t *frame) noexcept nogil:
    """Write the outputs into the template of a frame."""
    cdef datagram_t *d
    cdef copy_t *copy
    cdef uint32_t k, m
    for k in range(frame.first_datagram, frame.first_datagram + frame.datagram_count):
        d = &f.datagrams[k]
        for m in range(d.first_output, d.first_output + d.output_count):
            copy = &f.copies[m]
            memcpy(frame.template + copy.frame_offset, f.outputs + copy.image_offset, copy.size)


cdef void frames_fill(void *self) noexcept nogil:
    cdef frames_t *f = <frames_t *>self
    cdef uint32_t i
    for i in range(f.frame_count):
        fill_outputs(f, &f.frames[i])
    f.filled = 1


cdef inline void stamp(frames_t *f, frame_t *frame) noexcept nogil:
    """Write index and cycle number into the template of a frame."""
    cdef uint32_t k
    for k in range(frame.first_datagram, frame.first_datagram + frame.datagram_count):
        frame.template[f.datagrams[k].offset + 1] = frame.index
    if frame.number_offset:
        memcpy(frame.template + frame.number_offset, &f.serial, NUMBER_SIZE)


cdef inline void give_index(frames_t *f, uint32_t number) noexcept nogil:
    cdef sent_t *sent = &f.sent[f.next_index]
    f.frames[number].index = <uint8_t>f.next_index
    sent.frame = <uint16_t>number
    sent.serial = f.serial
    sent.answered = 0
    f.next_index = (f.next_index + 1) % INDEX_COUNT


cdef int frames_emit(void *self) noexcept nogil:
    cdef frames_t *f = <frames_t *>self
    cdef frame_t *frame
    cdef uint32_t i
    cdef int rc, first_error = 0
    f.serial += 1
    if f.serial == 0:  # 0 means never sent
        f.serial = 1
    if f.clock != NULL:  # its datagrams are in the first frame
        clock_emit(f.clock, f.link.now(f.link.self))
    f.missing = 0
    f.missing_needed = 0
    for i in range(f.frame_count):
        frame = &f.frames[i]
        frame.back = 0
        frame.judged = 0
        frame.due = frame.divider == 1 or f.serial % frame.divider == frame.phase
        if not frame.due:
            continue
        f.missing += 1
        f.missing_needed += frame.needed
        give_index(f, i)
        stamp(f, frame)
        if not f.filled:
            fill_outputs(f, frame)
        rc = f.link.send(f.link.self, frame.template, frame.length)
        if rc < 0:
            f.counters.send_errors += 1
            if first_error == 0:
                first_error = rc
    f.filled = 0
    forget_returns(f)
    return first_error


cdef void forget_returns(frames_t *f) noexcept nogil:
    """Reset the sums and flags of `judge` after the frames were sent."""
    cdef uint32_t unit
    for unit in range(f.image.unit_count):
        f.units[unit].right = 0
        f.units[unit].counter = 0
    f.right = 0
    f.judged = 0
    f.collected = 0
    f.al_seen = 0
    f.al_answered = 0


# ---- receive and match

cdef inline bint is_ours(const uint8_t *ours, const uint8_t *bytes) noexcept nogil:
    """Return True if source and EtherType (bytes 6 to 13) are ours. The source bit that controllers
    set is ignored."""
    return ((eight_at(bytes + SOURCE) ^ eight_at(ours + SOURCE)) & ~<uint64_t>SOURCE_PROCESSED) == 0


cdef inline bint is_shaped(const frames_t *f, const frame_t *frame, const uint8_t *bytes,
                           uint32_t length) noexcept nogil:
    """Return True if the datagrams match the template and all have the index of the frame.
    The addresses of clock datagrams change in each cycle. They are not compared, so that a late
    frame counts as stale, not as corrupt.
    """
    cdef const datagram_t *d
    cdef const datagram_t *end
    cdef uint8_t index = bytes[DATAGRAMS + 1]
    if length < frame.used or word_at(bytes + CAT_ETHERNET_HEADER) != word_at(
        frame.template + CAT_ETHERNET_HEADER
    ):
        return False
    d = &f.datagrams[frame.first_datagram]
    end = d + frame.datagram_count
    while d < end:
        if bytes[d.offset + 1] != index:
            return False
        if (eight_at(bytes + d.offset) ^ eight_at(frame.template + d.offset)) & d.header_mask:
            return False
        d += 1
    return True


cdef bint is_untouched(const frames_t *f, const frame_t *frame, const uint8_t *bytes) noexcept nogil:
    """Return True for an echo: the source bit is not set, and all working counters are 0."""
    cdef uint32_t k
    if bytes[SOURCE] != frame.template[SOURCE] or frame.template[SOURCE] & SOURCE_PROCESSED:
        return False
    for k in range(frame.first_datagram, frame.first_datagram + frame.datagram_count):
        if counter_of(&f.datagrams[k], bytes) != 0:
            return False
    return True


cdef inline int64_t stamp_of(frames_t *f) noexcept nogil:
    """Return the time at which the present frames were received."""
    if f.frame_stamp == 0:
        f.frame_stamp = f.link.now(f.link.self)
    return f.frame_stamp


cdef inline bint is_current(const frames_t *f, const frame_t *frame, const sent_t *sent,
                            const uint8_t *bytes) noexcept nogil:
    """Return True if the frame was sent in this cycle, according to index and cycle number."""
    if sent.serial != f.serial:
        return False
    return frame.number_offset == 0 or number_in(frame, bytes) == f.serial


cdef void count_stale(frames_t *f, const frame_t *frame, sent_t *sent,
                      const uint8_t *bytes) noexcept nogil:
    """Count a late frame. If it had returned before, or belongs to an older use of the index, it
    also counts as repeated.
    """
    f.counters.stale += 1
    if sent.answered or (frame.number_offset and number_in(frame, bytes) != sent.serial):
        f.counters.repeated += 1
    else:
        sent.answered = 1


cdef void take(frames_t *f, const uint8_t *bytes, uint32_t length) noexcept nogil:
    """Accept one received frame, pass it to the acyclic queue, or count it by kind and drop it."""
    cdef frame_t *frame
    cdef sent_t *sent
    if length < CAT_ETHERNET_HEADER or not is_ours(f.frames[0].template, bytes):
        f.counters.alien += 1
        return
    if length < DATAGRAMS + HEADER + CAT_DATAGRAM_COUNTER or length > CAT_FRAME_MAX:
        f.counters.corrupt += 1
        return
    if bytes[DATAGRAMS + 1] >= CYCLE_INDICES:
        acyclic_received(f.acyclic, bytes, length, stamp_of(f))
        return
    sent = &f.sent[bytes[DATAGRAMS + 1]]
    if sent.serial == 0:
        f.counters.alien += 1
        return
    frame = &f.frames[sent.frame]
    if not is_shaped(f, frame, bytes, length):
        f.counters.corrupt += 1
    elif not is_current(f, frame, sent, bytes):
        count_stale(f, frame, sent, bytes)
    elif is_untouched(f, frame, bytes):
        f.counters.unprocessed += 1
    elif frame.back:
        f.counters.duplicate += 1
        f.counters.repeated += 1
    else:
        frame.back = 1
        sent.answered = 1
        f.missing -= 1
        f.missing_needed -= frame.needed
        memcpy(frame.returned, bytes, frame.used)


cdef int drain(frames_t *f, int budget) noexcept nogil:
    """Take the frames that have arrived. Return the remaining budget."""
    cdef const uint8_t *bytes
    cdef int length
    while budget > 0:
        length = f.link.receive(f.link.self, &bytes)
        if length == 0:
            break
        budget -= 1
        if length < 0:
            f.counters.receive_errors += 1
            break
        take(f, bytes, <uint32_t>length)
    return budget


cdef int await_frames(frames_t *f, int64_t deadline, int budget) noexcept nogil:
    """Receive frames until all are back, the deadline has passed or the budget is used up.

    Return 0, or -errno of the wait.
    """
    cdef const cat_link *link = f.link
    cdef int rc
    while f.missing > 0 and budget > 0:
        if f.receive_mode == BUSY:
            if link.now(link.self) >= deadline:
                return 0
        else:
            rc = link.wait_until(link.self, deadline, f.receive_mode == WAIT)
            f.frame_stamp = link.now(link.self)
            if rc < 0 and rc != -EINTR:
                return rc
            if rc == 0 or f.frame_stamp >= deadline:
                drain(f, budget)
                return 0
        if f.receive_mode == BUSY:
            f.frame_stamp = link.now(link.self)
        budget = drain(f, budget)
    return 0


# ---- judge

cdef void judge_frame(frames_t *f, frame_t *frame) noexcept nogil:
    """Evaluate the datagrams of a returned frame once: working counters, AL status, clocks."""
    cdef datagram_t *d = &f.datagrams[frame.first_datagram]
    cdef const datagram_t *end = d + frame.datagram_count
    cdef uint16_t counter
    while d < end:
        counter = counter_of(d, frame.returned)
        d.right = counter == d.expected_counter
        f.right += d.right
        if d.unit >= 0:
            f.units[d.unit].right += d.right
            f.units[d.unit].counter += counter
        elif d.kind == AL_STATUS and counter > 0:
            f.al_answered += counter
            f.al_seen |= frame.returned[d.offset + HEADER] & (CAT_AL_STATE | CAT_AL_ERROR)
        elif d.kind == CLOCK and f.clock != NULL:
            clock_take(f.clock, d.command, frame.returned + d.offset + HEADER, counter)
        d += 1
    frame.judged = 1


cdef inline void judge_unit(frames_t *f, uint32_t unit) noexcept nogil:
    """Determine whether a unit that is due in this cycle is valid."""
    cdef bint valid = f.units[unit].right == f.units[unit].datagrams
    f.unit_valid[unit] = valid
    f.unit_fresh[unit] = valid
    f.unit_counter[unit] = f.units[unit].counter
    if valid:
        f.unit_missed[unit] = 0
        return
    if not f.judged and f.unit_missed[unit] < MISSED_MAX:
        f.unit_missed[unit] += 1
    if not f.units[unit].optional:
        f.ok = 0


cdef void judge_units(frames_t *f) noexcept nogil:
    cdef uint32_t unit
    f.ok = f.missing_needed == 0
    f.whole = 1
    for unit in range(f.image.unit_count):
        f.unit_fresh[unit] = 0
        if f.frames[f.units[unit].frame].due:
            judge_unit(f, unit)
        if not f.unit_valid[unit] and not f.units[unit].optional:
            f.whole = 0


cdef void copy_inputs(frames_t *f) noexcept nogil:
    """Copy the inputs of returned datagrams; for each unit, copy either all or none."""
    cdef const datagram_t *d = f.datagrams
    cdef const datagram_t *end = d + f.datagram_count
    cdef const frame_t *frame
    cdef const copy_t *copy
    cdef const copy_t *last
    while d < end:
        frame = &f.frames[d.frame]
        if frame.back and (f.unit_valid[d.unit] if d.unit >= 0 else d.right):
            copy = &f.copies[d.first_input]
            last = copy + d.input_count
            while copy < last:
                memcpy(f.inputs + copy.image_offset, frame.returned + copy.frame_offset, copy.size)
                copy += 1
        d += 1


cdef void judge(frames_t *f) noexcept nogil:
    """Evaluate a collect: frames, units, inputs.

    The units are unchanged if all datagrams had the expected working counter, now and in the last
    evaluation (`settled`).
    """
    cdef frame_t *frame = f.frames
    cdef const frame_t *last = frame + f.frame_count
    cdef bint all_right
    while frame < last:
        if frame.back and not frame.judged:
            judge_frame(f, frame)
        frame += 1
    f.al_counter = f.al_answered
    if f.al_counter > 0:
        f.al_status = f.al_seen
    all_right = f.right == f.datagram_count
    if not (all_right and f.settled):
        judge_units(f)
    f.settled = all_right
    f.judged = 1
    f.collected = f.missing == 0
    copy_inputs(f)


cdef void frames_drain(void *self) noexcept nogil:
    (<frames_t *>self).frame_stamp = 0
    drain(<frames_t *>self, DRAIN_MAX)


cdef int frames_collect(void *self, int64_t deadline) noexcept nogil:
    cdef frames_t *f = <frames_t *>self
    cdef int rc = 0, budget
    f.frame_stamp = 0 if deadline == 0 else f.link.now(f.link.self)
    budget = drain(f, DRAIN_MAX)
    if f.collected:
        return 0
    if deadline != 0:
        rc = await_frames(f, deadline, budget)
    judge(f)
    return rc if rc < 0 else <int>f.missing


cdef void frames_flush(frames_t *f) noexcept nogil:
    """Drop received frames and filled outputs before the first cycle."""
    cdef const uint8_t *bytes
    cdef int k
    f.filled = 0
    for k in range(4 * DRAIN_MAX):
        if f.link.receive(f.link.self, &bytes) <= 0:
            return


# ---- construction: the plan is checked once, so that the functions above need no checks

def check(condition, message):
    """Raise ValueError(message) unless the condition holds."""
    if not condition:
        raise ValueError(message)


def frames_per_cycle(frames):
    """Return an upper bound of the number of frames due in one cycle.

    It is the sum, over all dividers, of the number of frames in the fullest phase.
    The plan uses the same bound (plan/frames.py).
    """
    counts = {}
    for frame in frames:
        counts.setdefault(frame.divider, {}).setdefault(frame.phase, []).append(frame)
    return sum(max(map(len, phases.values())) for phases in counts.values())


def has_number(frame):
    """Return True if the frame contains a cycle number."""
    return any(d.kind == CYCLE_NUMBER for d in frame.datagrams)


cdef class Frames:
    def __cinit__(self, plan, link):
        check(PyCapsule_IsValid(link, CAT_LINK_CAPSULE), "link: not a capsule \"catenary.link\"")
        self.link_owner = link
        self.c.link = <const cat_link *>PyCapsule_GetPointer(link, CAT_LINK_CAPSULE)
        check(self.c.link.version == CAT_LINK_VERSION,
              f"link: table version {self.c.link.version}, expected {CAT_LINK_VERSION}")
        check(plan.receive_mode in RECEIVE_MODES,
              f"receive_mode: {plan.receive_mode!r}, must be one of {', '.join(RECEIVE_MODES)}")
        self.c.receive_mode = RECEIVE_MODES[plan.receive_mode]
        if self.c.link.flags & CAT_LINK_VIRTUAL_TIME and self.c.receive_mode == BUSY:
            self.c.receive_mode = WAIT  # virtual time passes only in a wait
        self.make_images(plan)
        self.make_frames(plan)
        self.make_table()

    def make_images(self, plan):
        for name in ("output_size", "input_size"):
            check(0 <= getattr(plan, name) < 1 << 20,
                  f"{name}: {getattr(plan, name)} bytes, must be 0 to {(1 << 20) - 1}")
        units = plan.sync_units
        cdef cat_memory *memory = &self.memory
        self.c.image.output_size = plan.output_size
        self.c.image.input_size = plan.input_size
        self.c.image.unit_count = len(units)
        self.c.outputs = <uint8_t *>memory_take(memory, plan.output_size + IMAGE_PADDING, 1)
        self.c.inputs = <uint8_t *>memory_take(memory, plan.input_size + IMAGE_PADDING, 1)
        self.c.unit_valid = <uint8_t *>memory_take(memory, len(units) + 1, 1)
        self.c.unit_fresh = <uint8_t *>memory_take(memory, len(units) + 1, 1)
        self.c.unit_missed = <uint32_t *>memory_take(memory, len(units) + 1, sizeof(uint32_t))
        self.c.unit_counter = <uint16_t *>memory_take(memory, len(units) + 1, sizeof(uint16_t))
        self.c.units = <unit_t *>memory_take(memory, len(units) + 1, sizeof(unit_t))
        for k, unit in enumerate(units):
            self.c.units[k].optional = 1 if unit.optional else 0

    def make_frames(self, plan):
        cdef cat_memory *memory = &self.memory
        datagrams = [d for frame in plan.frames for d in frame.datagrams]
        copies = sum(len(d.outputs) + len(d.inputs) for d in datagrams)
        check(1 <= len(plan.frames) <= FRAMES_MAX,
              f"frames: {len(plan.frames)}, must be 1 to {FRAMES_MAX}")
        limit = INDEX_COUNT if all(map(has_number, plan.frames)) else FRAMES_PER_CYCLE_MAX
        busiest = frames_per_cycle(plan.frames)
        check(busiest <= limit, f"frames: {busiest} in one cycle, at most {limit}")
        self.c.frames = <frame_t *>memory_take(memory, len(plan.frames), sizeof(frame_t))
        self.c.datagrams = <datagram_t *>memory_take(memory, len(datagrams) + 1, sizeof(datagram_t))
        self.c.copies = <copy_t *>memory_take(memory, copies + 1, sizeof(copy_t))
        self.c.frame_count = len(plan.frames)
        copies = 0
        for number, frame in enumerate(plan.frames):
            self.make_frame(number, frame)
            for d in frame.datagrams:
                copies = self.make_datagram(number, frame, d, copies)
        if plan.sync_units and all(unit.optional for unit in plan.sync_units):
            for number in range(self.c.frame_count):  # no device is required: a missing reply is not a loss
                self.c.frames[<int>number].needed = 0

    def make_frame(self, uint32_t number, frame):
        cdef bytes template = bytes(frame.template)
        check(CAT_FRAME_MIN <= len(template) <= CAT_FRAME_MAX,
              f"frame {number}: {len(template)} bytes, must be {CAT_FRAME_MIN} to {CAT_FRAME_MAX}")
        check(template[12:14] == b"\x88\xa4", f"frame {number}: EtherType is not 0x88A4")
        check(len(frame.datagrams) > 0, f"frame {number}: no datagrams")
        check(1 <= frame.divider <= DIVIDER_MAX and 0 <= frame.phase < frame.divider,
              f"frame {number}: divider {frame.divider} (must be 1 to {DIVIDER_MAX}), phase"
              f" {frame.phase} (must be at least 0 and less than the divider)")
        check(number > 0 or frame.divider == 1, "frame 0: divider must be 1")
        payload = int.from_bytes(template[14:16], "little")
        end = DATAGRAMS + sum(HEADER + d.length + CAT_DATAGRAM_COUNTER for d in frame.datagrams)
        check(payload >> 12 == 1 and DATAGRAMS + (payload & 0x7FF) == end and end <= len(template),
              f"frame {number}: EtherCAT header {payload:#06x} does not match the end of its datagrams at {end}")
        cdef frame_t *c = &self.c.frames[number]
        c.length = len(template)
        c.used = end
        c.first_datagram = self.c.datagram_count
        c.datagram_count = len(frame.datagrams)
        c.divider = frame.divider
        c.phase = frame.phase
        memcpy(c.template, <const uint8_t *>template, len(template))
        check(is_ours(self.c.frames[0].template, c.template),
              f"frame {number}: source address differs from frame 0")

    def make_datagram(self, uint32_t number, frame, plan, uint32_t copies):
        where = f"frame {number}, datagram at {plan.offset}"
        cdef uint32_t place = self.c.datagram_count
        cdef datagram_t *d = &self.c.datagrams[place]
        first = place == self.c.frames[number].first_datagram
        expected = DATAGRAMS if first else (
            self.c.datagrams[place - 1].offset + HEADER + self.c.datagrams[place - 1].length
            + CAT_DATAGRAM_COUNTER
        )
        check(plan.offset == expected, f"{where}: must be at {expected}")
        check(CAT_NOP <= plan.command <= CAT_FRMW,
              f"{where}: command {plan.command}, must be {CAT_NOP} to {CAT_FRMW}")
        header = frame.template[plan.offset : plan.offset + HEADER]
        check(header[0] == plan.command
              and int.from_bytes(header[6:8], "little") & 0x7FF == plan.length,
              f"{where}: command or length differs from the template")
        check(0 <= plan.expected_counter <= 0xFFFF,
              f"{where}: expected counter {plan.expected_counter}, must be 0 to 65535")
        check(-1 <= plan.sync_unit < <int>self.c.image.unit_count,
              f"{where}: no sync unit {plan.sync_unit}, the plan has {self.c.image.unit_count}")
        check(plan.kind in (PROCESS_DATA, AL_STATUS, CLOCK, CYCLE_NUMBER),
              f"{where}: unknown kind {plan.kind}")
        check(plan.kind != AL_STATUS or plan.length >= 2, f"{where}: AL status needs two bytes")
        check(plan.kind == PROCESS_DATA or plan.sync_unit < 0,
              f"{where}: a datagram of kind {plan.kind} cannot belong to a sync unit")
        if plan.kind == CYCLE_NUMBER:
            self.place_number(where, plan, number)
        if plan.sync_unit >= 0:
            self.place_unit(where, plan.sync_unit, number)
            self.c.units[<uint32_t>plan.sync_unit].datagrams += 1
        d.kind = plan.kind
        d.command = plan.command
        d.header_mask = int.from_bytes(self.kept(plan), "little")
        d.length = plan.length
        d.expected_counter = plan.expected_counter
        d.unit = plan.sync_unit
        d.frame = number
        d.offset = plan.offset
        d.first_output = copies
        d.output_count = len(plan.outputs)
        d.first_input = copies + len(plan.outputs)
        d.input_count = len(plan.inputs)
        for copy in plan.outputs:
            copies = self.make_copy(where, plan, copy, self.c.image.output_size, copies)
        for copy in plan.inputs:
            copies = self.make_copy(where, plan, copy, self.c.image.input_size, copies)
        if d.unit < 0:
            self.c.frames[number].needed |= plan.kind != CYCLE_NUMBER
        elif not self.c.units[d.unit].optional:
            self.c.frames[number].needed = 1
        self.c.datagram_count += 1
        return copies

    def place_number(self, where, plan, uint32_t number):
        cdef frame_t *frame = &self.c.frames[number]
        check(plan.command == CAT_NOP and plan.length == NUMBER_SIZE and plan.expected_counter == 0,
              f"{where}: a cycle number must be a NOP of {NUMBER_SIZE} bytes with counter 0")
        check(frame.number_offset == 0, f"{where}: the frame already has a cycle number")
        frame.number_offset = plan.offset + HEADER

    def kept(self, plan):
        """Return the mask of the bits in the first eight bytes of a header that return unchanged.
        The index, the circulating bit and the reserved bits of the length word are excluded.
        """
        # The address of a clock datagram changes in each cycle.
        adp = plan.command not in ADDRESS_MOVES and plan.kind != CLOCK
        ado = plan.kind != CLOCK
        return bytes((0xFF, 0, *[0xFF * adp] * 2, *[0xFF * ado] * 2, 0xFF, 0x87))

    def place_unit(self, where, uint32_t unit, uint32_t number):
        """Check that all frames of a unit are due in the same cycles."""
        cdef frame_t *first
        if not self.c.unit_valid[unit]:  # used as a marker until the first cycle
            self.c.unit_valid[unit] = 1
            self.c.units[unit].frame = number
        first = &self.c.frames[self.c.units[unit].frame]
        check((first.divider, first.phase) == (self.c.frames[number].divider, self.c.frames[number].phase),
              f"{where}: all frames of its sync unit must have the same divider and phase")

    def make_copy(self, where, plan, copy, uint32_t image_size, uint32_t place):
        start = plan.offset + HEADER
        check(copy.size > 0 and start <= copy.frame_offset
              and copy.frame_offset + copy.size <= start + plan.length,
              f"{where}: a copy of {copy.size} bytes at {copy.frame_offset} exceeds the data")
        check(0 <= copy.image_offset and copy.image_offset + copy.size <= image_size,
              f"{where}: a copy of {copy.size} bytes at {copy.image_offset} exceeds the image")
        cdef copy_t *c = &self.c.copies[place]
        c.frame_offset = copy.frame_offset
        c.image_offset = copy.image_offset
        c.size = copy.size
        return place + 1

    cdef carry_time(self, clock_t *clock):
        """Connect the clock to its datagrams in the templates."""
        cdef uint32_t k
        cdef datagram_t *d
        cdef uint8_t *header
        for k in range(self.c.datagram_count):
            d = &self.c.datagrams[k]
            if d.kind != CLOCK:
                continue
            check(d.frame == 0 and d.length == 4,
                  "clock: its datagrams must have four bytes, in the first frame")
            header = self.c.frames[0].template + d.offset
            if d.command == CAT_FRMW:
                clock.time_header = header
                clock.listeners = d.expected_counter
            elif d.command == CAT_FPWR:
                clock.main_header = header
            elif d.command == CAT_FPRD:
                clock.watch_header = header
        check(clock.time_header != NULL, "clock: no datagram reads the time of the reference")
        check((clock.main_header != NULL) == (clock.follows_main != 0),
              "clock: a plan needs an FPWR datagram if the reference follows us, and only then")
        check((clock.watch_header != NULL) == (clock.follower_count > 0),
              "clock: a plan needs an FPRD datagram if it has followers, and only then")
        self.c.clock = clock

    cdef make_table(self):
        self.c.image.version = CAT_IMAGE_VERSION
        self.c.image.self = &self.c
        self.c.image.outputs = self.c.outputs
        self.c.image.inputs = self.c.inputs
        for unit in range(self.c.image.unit_count):
            check(self.c.unit_valid[unit], f"no frame contains sync unit {unit}")
            self.c.unit_valid[unit] = 0
        self.c.image.unit_valid = self.c.unit_valid
        self.c.image.unit_fresh = self.c.unit_fresh
        self.c.image.unit_missed = self.c.unit_missed
        self.c.image.whole = &self.c.whole
        self.c.image.unit_counter = self.c.unit_counter
        self.c.image.ok = &self.c.ok
        self.c.image.al_status = &self.c.al_status
        self.c.image.al_counter = &self.c.al_counter
        self.c.image.frame_stamp = &self.c.frame_stamp
        self.c.image.emit = frames_emit
        self.c.image.collect = frames_collect
        self.c.image.drain = frames_drain
        self.c.image.fill = frames_fill

    def __dealloc__(self):
        cat_memory_free(&self.memory)
