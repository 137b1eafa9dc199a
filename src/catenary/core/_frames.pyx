# cython: boundscheck=False, wraparound=False, cdivision=True
"""The frame engine: the image table (native/image.h) on a link (native/link.h).

Templates are built by the plan; a cycle patches indices and outputs, sends, and believes a returned
frame only where index, commands, addresses, lengths and working counters are those expected
(ETG.1000.4 §5.4). Budget for three drives in one frame: emit 0.2 us, collect 0.3 us, without the link.
"""

from cpython.pycapsule cimport PyCapsule_GetPointer, PyCapsule_IsValid
from libc.errno cimport EINTR
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy

from catenary.core._clocks cimport FPRD, FPWR, FRMW, clock_emit, clock_t, clock_take
from catenary.core._lane cimport lane_received
from catenary.core._native cimport (
    CAT_FRAME_MAX,
    CAT_FRAME_MIN,
    CAT_IMAGE_VERSION,
    CAT_LINK_CAPSULE,
    CAT_LINK_VERSION,
    CAT_LINK_VIRTUAL_TIME,
    cat_link,
)
from catenary.core._numbers cimport IMAGE_PADDING

cdef enum:
    SOURCE = 6                 # offset of the source address
    SOURCE_PROCESSED = 0x02    # set in its first byte by the first controller passed
    ETHERCAT_HEADER = 14
    DATAGRAMS = 16
    HEADER = 10                # of a datagram
    COUNTER = 2
    CYCLE_INDICES = 0x80
    DRAIN_MAX = 256            # frames looked at in one collect: a flood cannot hold the cycle up
    EVERY_MAX = 10000
    MISSED_MAX = 1000000000

cdef enum:
    PROCESS_DATA = 0
    AL_STATUS = 1
    CLOCK = 2

# APRD, APWR, APRW, BRD, BWR, BRW, ARMW: every device adds one to the position (ETG.1000.4 §5.4.1)
ADDRESS_MOVES = frozenset((1, 2, 3, 7, 8, 9, 13))
COMMAND_MAX = 14
RECEIVE_MODES = {"look": LOOK, "wait": WAIT, "spin": SPIN}


cdef inline uint16_t word_at(const uint8_t *bytes) noexcept nogil:
    return <uint16_t>(bytes[0] | (bytes[1] << 8))


cdef inline uint64_t eight_at(const uint8_t *bytes) noexcept nogil:
    cdef uint64_t word
    memcpy(&word, bytes, 8)
    return word


cdef inline uint16_t counter_of(const datagram_t *d, const uint8_t *frame) noexcept nogil:
    return word_at(frame + d.offset + HEADER + d.length)


# ---- emit

cdef inline void fill(frames_t *f, frame_t *frame) noexcept nogil:
    """Index and outputs into a frame's template."""
    cdef datagram_t *d
    cdef copy_t *copy
    cdef uint32_t k, m
    for k in range(frame.first_datagram, frame.first_datagram + frame.datagram_count):
        d = &f.datagrams[k]
        frame.template[d.offset + 1] = frame.index
        for m in range(d.first_output, d.first_output + d.output_count):
            copy = &f.copies[m]
            memcpy(frame.template + copy.frame_offset, f.outputs + copy.image_offset, copy.size)


cdef int frames_emit(void *self) noexcept nogil:
    cdef frames_t *f = <frames_t *>self
    cdef frame_t *frame
    cdef uint32_t i
    cdef int rc, first_error = 0
    f.serial += 1
    if f.serial == 0:  # which says: never sent
        f.serial = 1
    if f.clock != NULL:  # its datagrams are in the frame that goes first
        clock_emit(f.clock, f.link.now(f.link.self))
    f.missing = 0
    f.wrong = 0
    f.judged = 0
    f.collected = 0
    f.al_seen = 0
    f.al_answered = 0
    for i in range(f.frame_count):
        frame = &f.frames[i]
        frame.back = 0
        frame.noted = 0
        frame.due = frame.every == 1 or f.serial % frame.every == frame.phase
        if not frame.due:
            continue
        f.missing += 1
        frame.index = <uint8_t>f.next_index
        f.frame_of_index[f.next_index] = <uint8_t>i
        f.serial_of_index[f.next_index] = f.serial
        f.next_index = (f.next_index + 1) % INDEX_COUNT
        fill(f, frame)
        rc = f.link.send(f.link.self, frame.template, frame.length)
        if rc < 0:
            f.counters.send_errors += 1
            if first_error == 0:
                first_error = rc
    return first_error


# ---- collect

cdef inline bint is_ours(const uint8_t *ours, const uint8_t *bytes) noexcept nogil:
    """Same source, but for the bit that controllers set, and EtherType: bytes 6 to 13 of a frame."""
    return ((eight_at(bytes + SOURCE) ^ eight_at(ours + SOURCE)) & ~<uint64_t>SOURCE_PROCESSED) == 0


cdef inline bint is_shaped(const frames_t *f, const frame_t *frame, const uint8_t *bytes,
                           uint32_t length) noexcept nogil:
    """The template's datagrams, with the index of the frame. Those of the clocks are addressed to
    another device each cycle: a late frame is stale, not corrupt."""
    cdef const datagram_t *d
    cdef const datagram_t *end
    cdef uint8_t index = bytes[DATAGRAMS + 1]
    if length < frame.used or word_at(bytes + ETHERCAT_HEADER) != word_at(
        frame.template + ETHERCAT_HEADER
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
    """An echo: no controller has set its bit of the source address nor counted."""
    cdef uint32_t k
    if bytes[SOURCE] != frame.template[SOURCE] or frame.template[SOURCE] & SOURCE_PROCESSED:
        return False
    for k in range(frame.first_datagram, frame.first_datagram + frame.datagram_count):
        if counter_of(&f.datagrams[k], bytes) != 0:
            return False
    return True


cdef inline int64_t stamp_of(frames_t *f) noexcept nogil:
    """When what is being taken was seen."""
    if f.frame_stamp == 0:
        f.frame_stamp = f.link.now(f.link.self)
    return f.frame_stamp


cdef void take(frames_t *f, const uint8_t *bytes, uint32_t length) noexcept nogil:
    """One received frame: the cycle's, the lane's, or counted by kind and forgotten."""
    cdef frame_t *frame
    cdef uint8_t index
    if length < ETHERCAT_HEADER or not is_ours(f.frames[0].template, bytes):
        f.counters.alien += 1
        return
    if length < DATAGRAMS + HEADER + COUNTER or length > CAT_FRAME_MAX:
        f.counters.corrupt += 1
        return
    index = bytes[DATAGRAMS + 1]
    if index >= CYCLE_INDICES:
        lane_received(f.lane, bytes, length, stamp_of(f))
        return
    if f.serial_of_index[index] == 0:
        f.counters.alien += 1
        return
    frame = &f.frames[f.frame_of_index[index]]
    if not is_shaped(f, frame, bytes, length):
        f.counters.corrupt += 1
    elif f.serial_of_index[index] != f.serial:
        f.counters.stale += 1
    elif is_untouched(f, frame, bytes):
        f.counters.unprocessed += 1
    elif frame.back:
        f.counters.duplicate += 1
    else:
        frame.back = 1
        f.missing -= 1
        memcpy(frame.returned, bytes, frame.used)


cdef int drain(frames_t *f, int budget) noexcept nogil:
    """Takes what has arrived; what is left of the budget."""
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
    """Until all frames are back or the deadline has come. 0, or -errno of the wait."""
    cdef const cat_link *link = f.link
    cdef int rc
    while f.missing > 0 and budget > 0:
        if f.receive_mode == SPIN:
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
        if f.receive_mode == SPIN:
            f.frame_stamp = link.now(link.self)
        budget = drain(f, budget)
    return 0


cdef void note(frames_t *f, frame_t *frame) noexcept nogil:
    """The working counters of a frame that is back; what AL states and clocks say beside their data."""
    cdef datagram_t *d = &f.datagrams[frame.first_datagram]
    cdef const datagram_t *end = d + frame.datagram_count
    while d < end:
        d.counter = counter_of(d, frame.returned)
        if d.counter != d.expected_counter:
            f.wrong = 1
        if d.kind == AL_STATUS:
            if d.counter > 0:
                f.al_answered += d.counter
                f.al_seen |= frame.returned[d.offset + HEADER] & 0x1F
        elif d.kind == CLOCK and f.clock != NULL:
            clock_take(f.clock, d.command, frame.returned + d.offset + HEADER, d.counter)
        d += 1
    frame.noted = 1


cdef inline bint are_good(const frames_t *f, const datagram_t *d) noexcept nogil:
    """The inputs of a datagram, where not all are: those of a unit count together."""
    if not f.frames[d.frame].back:
        return False
    if d.unit >= 0:
        return f.unit_valid[d.unit] != 0
    return d.counter == d.expected_counter


cdef inline void copy_inputs(frames_t *f, const datagram_t *d) noexcept nogil:
    cdef const uint8_t *returned = f.frames[d.frame].returned
    cdef const copy_t *copy = &f.copies[d.first_input]
    cdef const copy_t *end = copy + d.input_count
    while copy < end:
        memcpy(f.inputs + copy.image_offset, returned + copy.frame_offset, copy.size)
        copy += 1


cdef void settle(frames_t *f) noexcept nogil:
    """Every unit: valid, now."""
    cdef uint32_t unit
    for unit in range(f.image.unit_count):
        f.unit_valid[unit] = 1
        f.unit_fresh[unit] = 1
        f.unit_missed[unit] = 0
        f.unit_counter[unit] = f.unit_expected[unit]
    f.ok = 1
    f.whole = 1
    f.settled = 1


cdef inline void judge_unit(frames_t *f, uint32_t unit) noexcept nogil:
    """A unit that was due."""
    if f.unit_valid[unit]:
        f.unit_missed[unit] = 0
        return
    f.unit_fresh[unit] = 0
    if not f.judged and f.unit_missed[unit] < MISSED_MAX:
        f.unit_missed[unit] += 1
    if not f.unit_optional[unit]:
        f.ok = 0


cdef void judge_units(frames_t *f) noexcept nogil:
    """Which sync units are valid, and whether the cycle was good, where something was not due, not
    back or not right."""
    cdef const datagram_t *d
    cdef uint32_t k, unit
    f.settled = 0
    f.ok = 1
    f.whole = 1
    for unit in range(f.image.unit_count):
        f.unit_fresh[unit] = f.frames[f.unit_frame[unit]].due
        if f.unit_fresh[unit]:
            f.unit_valid[unit] = 1
            f.unit_counter[unit] = 0
    for k in range(f.frame_count):
        if f.frames[k].needed and f.frames[k].due and not f.frames[k].back:
            f.ok = 0
    for k in range(f.datagram_count):
        d = &f.datagrams[k]
        if d.unit < 0 or not f.frames[d.frame].due:
            continue
        if f.frames[d.frame].back:
            f.unit_counter[d.unit] += d.counter
        if not f.frames[d.frame].back or d.counter != d.expected_counter:
            f.unit_valid[d.unit] = 0
    for unit in range(f.image.unit_count):
        if f.unit_fresh[unit]:
            judge_unit(f, unit)
        if not f.unit_valid[unit] and not f.unit_optional[unit]:
            f.whole = 0


cdef void judge(frames_t *f) noexcept nogil:
    """What has come back: counters, valid units, their inputs."""
    cdef frame_t *frame = f.frames
    cdef const frame_t *last = frame + f.frame_count
    cdef const datagram_t *d = f.datagrams
    cdef const datagram_t *end = d + f.datagram_count
    cdef bint right
    while frame < last:
        if frame.back and not frame.noted:
            note(f, frame)
        frame += 1
    f.al_counter = f.al_answered
    if f.al_counter > 0:
        f.al_status = f.al_seen
    right = f.all_due and f.missing == 0 and not f.wrong and f.serial != 0
    if not right:
        judge_units(f)
    elif not f.settled:
        settle(f)
    f.judged = 1
    f.collected = f.missing == 0
    while d < end:
        if d.input_count > 0 and (right or are_good(f, d)):
            copy_inputs(f, d)
        d += 1


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
    """Forgets what arrived before the first cycle; frames of a former run are no news."""
    cdef const uint8_t *bytes
    cdef int k
    for k in range(4 * DRAIN_MAX):
        if f.link.receive(f.link.self, &bytes) <= 0:
            return


# ---- the edge: a plan is checked once, so that nothing above needs to

def check(condition, message):
    """ValueError with `message` unless `condition`."""
    if not condition:
        raise ValueError(message)


cdef class Frames:
    def __cinit__(self, plan, link):
        check(PyCapsule_IsValid(link, CAT_LINK_CAPSULE), "link: not a capsule \"catenary.link\"")
        self.link_owner = link
        self.c.link = <const cat_link *>PyCapsule_GetPointer(link, CAT_LINK_CAPSULE)
        check(self.c.link.version == CAT_LINK_VERSION,
              f"link: table version {self.c.link.version}, expected {CAT_LINK_VERSION}")
        check(plan.receive_mode in RECEIVE_MODES, f"receive_mode: {plan.receive_mode!r}")
        self.c.receive_mode = RECEIVE_MODES[plan.receive_mode]
        if self.c.link.flags & CAT_LINK_VIRTUAL_TIME and self.c.receive_mode == SPIN:
            self.c.receive_mode = WAIT  # virtual time passes only in a wait
        self.make_images(plan)
        self.make_frames(plan)
        self.make_table()

    def make_images(self, plan):
        for name in ("output_size", "input_size"):
            check(0 <= getattr(plan, name) < 1 << 20, f"{name}: {getattr(plan, name)}")
        units = plan.sync_units
        self.c.image.output_size = plan.output_size
        self.c.image.input_size = plan.input_size
        self.c.image.unit_count = len(units)
        self.c.outputs = <uint8_t *>calloc(plan.output_size + IMAGE_PADDING, 1)
        self.c.inputs = <uint8_t *>calloc(plan.input_size + IMAGE_PADDING, 1)
        self.c.unit_valid = <uint8_t *>calloc(len(units) + 1, 1)
        self.c.unit_fresh = <uint8_t *>calloc(len(units) + 1, 1)
        self.c.unit_missed = <uint32_t *>calloc(len(units) + 1, sizeof(uint32_t))
        self.c.unit_frame = <uint32_t *>calloc(len(units) + 1, sizeof(uint32_t))
        self.c.unit_optional = <uint8_t *>calloc(len(units) + 1, 1)
        self.c.unit_counter = <uint16_t *>calloc(len(units) + 1, sizeof(uint16_t))
        self.c.unit_expected = <uint16_t *>calloc(len(units) + 1, sizeof(uint16_t))
        if not (self.c.outputs and self.c.inputs and self.c.unit_valid and self.c.unit_optional
                and self.c.unit_counter and self.c.unit_expected and self.c.unit_fresh
                and self.c.unit_missed and self.c.unit_frame):
            raise MemoryError
        for k, unit in enumerate(units):
            self.c.unit_optional[k] = 1 if unit.optional else 0

    def make_frames(self, plan):
        datagrams = [d for frame in plan.frames for d in frame.datagrams]
        copies = sum(len(d.outputs) + len(d.inputs) for d in datagrams)
        check(1 <= len(plan.frames) <= FRAME_COUNT_MAX,
              f"frames: {len(plan.frames)}, at least 1 and at most {FRAME_COUNT_MAX}")
        self.c.frames = <frame_t *>calloc(len(plan.frames), sizeof(frame_t))
        self.c.datagrams = <datagram_t *>calloc(len(datagrams) + 1, sizeof(datagram_t))
        self.c.copies = <copy_t *>calloc(copies + 1, sizeof(copy_t))
        if not (self.c.frames and self.c.datagrams and self.c.copies):
            raise MemoryError
        self.c.frame_count = len(plan.frames)
        self.c.all_due = all(frame.every == 1 for frame in plan.frames)
        copies = 0
        for number, frame in enumerate(plan.frames):
            self.make_frame(number, frame)
            for d in frame.datagrams:
                copies = self.make_datagram(number, frame, d, copies)

    def make_frame(self, uint32_t number, frame):
        cdef bytes template = bytes(frame.template)
        check(CAT_FRAME_MIN <= len(template) <= CAT_FRAME_MAX,
              f"frame {number}: {len(template)} bytes, must be {CAT_FRAME_MIN} to {CAT_FRAME_MAX}")
        check(template[12:14] == b"\x88\xa4", f"frame {number}: EtherType is not 0x88A4")
        check(len(frame.datagrams) > 0, f"frame {number}: no datagrams")
        check(1 <= frame.every <= EVERY_MAX and 0 <= frame.phase < frame.every,
              f"frame {number}: every {frame.every} cycles, phase {frame.phase}")
        check(number > 0 or frame.every == 1, "frame 0 goes out in every cycle")
        payload = int.from_bytes(template[14:16], "little")
        end = DATAGRAMS + sum(HEADER + d.length + COUNTER for d in frame.datagrams)
        check(payload >> 12 == 1 and DATAGRAMS + (payload & 0x7FF) == end and end <= len(template),
              f"frame {number}: its EtherCAT header says {payload:#06x}, its datagrams end at {end}")
        cdef frame_t *c = &self.c.frames[number]
        c.length = len(template)
        c.used = end
        c.first_datagram = self.c.datagram_count
        c.datagram_count = len(frame.datagrams)
        c.every = frame.every
        c.phase = frame.phase
        memcpy(c.template, <const uint8_t *>template, len(template))
        check(is_ours(self.c.frames[0].template, c.template),
              f"frame {number}: another source than frame 0")

    def make_datagram(self, uint32_t number, frame, plan, uint32_t copies):
        where = f"frame {number}, datagram at {plan.offset}"
        cdef uint32_t place = self.c.datagram_count
        cdef datagram_t *d = &self.c.datagrams[place]
        first = place == self.c.frames[number].first_datagram
        expected = DATAGRAMS if first else (
            self.c.datagrams[place - 1].offset + HEADER + self.c.datagrams[place - 1].length + COUNTER
        )
        check(plan.offset == expected, f"{where}: expected at {expected}")
        check(0 <= plan.command <= COMMAND_MAX, f"{where}: command {plan.command}")
        header = frame.template[plan.offset : plan.offset + HEADER]
        check(header[0] == plan.command
              and int.from_bytes(header[6:8], "little") & 0x7FF == plan.length,
              f"{where}: command or length differ from the template's")
        check(0 <= plan.expected_counter <= 0xFFFF, f"{where}: counter {plan.expected_counter}")
        check(-1 <= plan.sync_unit < <int>self.c.image.unit_count,
              f"{where}: sync unit {plan.sync_unit} of {self.c.image.unit_count}")
        check(plan.kind in (PROCESS_DATA, AL_STATUS, CLOCK), f"{where}: kind {plan.kind}")
        check(plan.kind != AL_STATUS or plan.length >= 2, f"{where}: AL status has two bytes")
        if plan.sync_unit >= 0:
            self.place_unit(where, plan.sync_unit, number)
            self.c.unit_expected[<uint32_t>plan.sync_unit] += <uint16_t>plan.expected_counter
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
        if d.unit < 0 or not self.c.unit_optional[d.unit]:
            self.c.frames[number].needed = 1
        self.c.datagram_count += 1
        return copies

    def kept(self, plan):
        """Of the first eight bytes of a header, the bits that come back as they were sent: not the
        index, nor the circulating bit and the reserved ones of the length word."""
        adp = plan.command not in ADDRESS_MOVES and plan.kind != CLOCK  # another each cycle
        ado = plan.kind != CLOCK
        return bytes((0xFF, 0, *[0xFF * adp] * 2, *[0xFF * ado] * 2, 0xFF, 0x87))

    def place_unit(self, where, uint32_t unit, uint32_t number):
        """All frames of a unit are due in the same cycles."""
        cdef frame_t *first
        if not self.c.unit_valid[unit]:  # used as a mark until the first cycle
            self.c.unit_valid[unit] = 1
            self.c.unit_frame[unit] = number
        first = &self.c.frames[self.c.unit_frame[unit]]
        check((first.every, first.phase) == (self.c.frames[number].every, self.c.frames[number].phase),
              f"{where}: its sync unit rides in frames of other cycles too")

    def make_copy(self, where, plan, copy, uint32_t image_size, uint32_t place):
        start = plan.offset + HEADER
        check(copy.size > 0 and start <= copy.frame_offset
              and copy.frame_offset + copy.size <= start + plan.length,
              f"{where}: a copy of {copy.size} bytes at {copy.frame_offset} leaves its data")
        check(0 <= copy.image_offset and copy.image_offset + copy.size <= image_size,
              f"{where}: a copy of {copy.size} bytes at {copy.image_offset} leaves the image")
        cdef copy_t *c = &self.c.copies[place]
        c.frame_offset = copy.frame_offset
        c.image_offset = copy.image_offset
        c.size = copy.size
        return place + 1

    cdef carry_time(self, clock_t *clock):
        """Shows the clock where its data sits in the templates."""
        cdef uint32_t k
        cdef datagram_t *d
        cdef uint8_t *header
        for k in range(self.c.datagram_count):
            d = &self.c.datagrams[k]
            if d.kind != CLOCK:
                continue
            check(d.frame == 0 and d.length == 4, "clock: four bytes each, in the first frame")
            header = self.c.frames[0].template + d.offset
            if d.command == FRMW:
                clock.time_header = header
                clock.listeners = d.expected_counter
            elif d.command == FPWR:
                clock.main_header = header
            elif d.command == FPRD:
                clock.watch_header = header
        check(clock.time_header != NULL, "clock: no frame carries the reference's time")
        check((clock.main_header != NULL) == (clock.follows_main != 0),
              "clock: our time is sent when the reference follows us, and only then")
        check((clock.watch_header != NULL) == (clock.follower_count > 0),
              "clock: differences are read of followers, and only of them")
        self.c.clock = clock

    cdef make_table(self):
        self.c.image.version = CAT_IMAGE_VERSION
        self.c.image.self = &self.c
        self.c.image.outputs = self.c.outputs
        self.c.image.inputs = self.c.inputs
        for unit in range(self.c.image.unit_count):
            check(self.c.unit_valid[unit], f"sync unit {unit} is in no frame")
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

    def __dealloc__(self):
        free(self.c.frames)
        free(self.c.datagrams)
        free(self.c.copies)
        free(self.c.outputs)
        free(self.c.inputs)
        free(self.c.unit_valid)
        free(self.c.unit_fresh)
        free(self.c.unit_missed)
        free(self.c.unit_frame)
        free(self.c.unit_optional)
        free(self.c.unit_counter)
        free(self.c.unit_expected)
