"""Link that replays the answers of a recorded segment, deterministically and in virtual time.

A question is a sent frame. It is found in the recording by its datagrams with all indices set to 0
(FNV-1a hash, then comparison). The answers to the same question are returned in the recorded order.
The last answer is repeated. An answer gets the indices of the sent frame and arrives after the
recorded latency.
"""

from libc.errno cimport EINVAL, EMSGSIZE, ENOBUFS
from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcmp, memcpy

from catenary.link._table cimport CAT_FRAME_MAX, CAT_LINK_VIRTUAL_TIME, TableLink

import os

from catenary.errors import DecodeError
from catenary.link.frame_pairs import Exchange, by_question, read_exchanges

LATENCY_MAX = 900 * 10**9             # [ns] a quarter of an hour

cdef enum:
    QUEUE = 64                        # pending answers; a power of two
    HEADER_SIZE = 16                  # Ethernet and EtherCAT headers
    DATAGRAM_HEADER = 10
    DATAGRAM_OVERHEAD = 12            # header and working counter

ctypedef struct answer:
    const uint8_t *bytes
    uint32_t length
    int64_t latency_ns

ctypedef struct question:             # a slot of the hash table; answer_count 0: empty
    const uint8_t *bytes
    uint32_t length
    uint32_t first_answer
    uint32_t answer_count
    uint32_t next_answer
    uint64_t hash

ctypedef struct queued:
    uint32_t length
    int64_t due
    uint8_t bytes[CAT_FRAME_MAX]

ctypedef struct replay_state:
    int64_t time
    question *questions
    uint32_t mask                     # slots - 1
    answer *answers
    uint32_t head
    uint32_t tail
    uint64_t answered
    uint64_t unmatched
    uint32_t unmatched_length
    uint8_t unmatched_frame[CAT_FRAME_MAX]
    queued queue[QUEUE]


cdef uint64_t hash_of(const uint8_t *data, uint32_t length) noexcept nogil:
    """Return the FNV-1a hash, 64 bits."""
    cdef uint64_t value = <uint64_t> 0xCBF29CE484222325
    cdef uint32_t i
    for i in range(length):
        value = (value ^ data[i]) * <uint64_t> 0x100000001B3
    return value


cdef uint32_t datagram_size(const uint8_t *datagram) noexcept nogil:
    return DATAGRAM_OVERHEAD + (datagram[6] | (datagram[7] & 7) << 8)


cdef uint32_t ask(const uint8_t *frame, uint32_t length, uint8_t *asked) noexcept nogil:
    """Copy the datagrams, set their indices to 0 and return their length; 0 if malformed."""
    cdef uint32_t at = HEADER_SIZE
    cdef uint32_t size
    while at + DATAGRAM_OVERHEAD <= length:
        size = datagram_size(frame + at)
        if at + size > length:
            return 0
        memcpy(asked + at - HEADER_SIZE, frame + at, size)
        asked[at - HEADER_SIZE + 1] = 0
        if not frame[at + 7] & 0x80:  # no more datagrams follow
            return at + size - HEADER_SIZE
        at += size
    return 0


cdef question *find(replay_state *replay, const uint8_t *asked, uint32_t length) noexcept nogil:
    """Return the slot of this question, or the empty slot for it."""
    cdef uint64_t value = hash_of(asked, length)
    cdef uint32_t at = <uint32_t> value & replay.mask
    cdef question *slot = &replay.questions[at]
    while slot.answer_count > 0:
        if slot.hash == value and slot.length == length and memcmp(slot.bytes, asked, length) == 0:
            return slot
        at = (at + 1) & replay.mask
        slot = &replay.questions[at]
    return slot


cdef void copy_indices(uint8_t *reply, uint32_t length, const uint8_t *frame) noexcept nogil:
    """Copy the indices of the question to the answer, which has the same datagrams."""
    cdef uint32_t at = HEADER_SIZE
    while at + DATAGRAM_OVERHEAD <= length:
        reply[at + 1] = frame[at + 1]
        if not frame[at + 7] & 0x80:
            return
        at += datagram_size(frame + at)


cdef int replay_send(void *self, const uint8_t *frame, uint32_t length) noexcept nogil:
    cdef replay_state *replay = <replay_state *> self
    cdef uint8_t asked[CAT_FRAME_MAX]
    cdef uint32_t size
    cdef question *slot
    if length > CAT_FRAME_MAX:
        return -EMSGSIZE
    if length < HEADER_SIZE:
        return -EINVAL
    size = ask(frame, length, asked)
    slot = find(replay, asked, size)
    if slot.answer_count == 0:
        if replay.unmatched == 0:
            memcpy(replay.unmatched_frame, frame, length)
            replay.unmatched_length = length
        replay.unmatched += 1
        return 0
    return put_under_way(replay, slot, frame)


cdef int put_under_way(replay_state *replay, question *slot, const uint8_t *frame) noexcept nogil:
    cdef answer *reply
    cdef queued *place
    cdef int64_t last = 0
    if replay.head - replay.tail >= QUEUE - 1:  # one slot is lent to the receiver
        return -ENOBUFS
    if replay.head != replay.tail:
        last = replay.queue[(replay.head - 1) & (QUEUE - 1)].due
    reply = &replay.answers[slot.first_answer + slot.next_answer]
    if slot.next_answer + 1 < slot.answer_count:
        slot.next_answer += 1
    place = &replay.queue[replay.head & (QUEUE - 1)]
    place.length = reply.length
    place.due = max(replay.time + reply.latency_ns, last)  # a cable preserves the order
    memcpy(place.bytes, reply.bytes, reply.length)
    copy_indices(place.bytes, reply.length, frame)
    replay.head += 1
    replay.answered += 1
    return 0


cdef int replay_receive(void *self, const uint8_t **frame) noexcept nogil:
    cdef replay_state *replay = <replay_state *> self
    cdef queued *place = &replay.queue[replay.tail & (QUEUE - 1)]
    if replay.head == replay.tail or place.due > replay.time:
        return 0
    replay.tail += 1
    frame[0] = place.bytes
    return <int> place.length


cdef int64_t replay_now(void *self) noexcept nogil:
    return (<replay_state *> self).time


cdef int replay_wait_until(void *self, int64_t deadline, int wake_on_frame) noexcept nogil:
    cdef replay_state *replay = <replay_state *> self
    cdef int64_t due
    if wake_on_frame and replay.head != replay.tail:
        due = replay.queue[replay.tail & (QUEUE - 1)].due
        if due <= max(deadline, replay.time):
            replay.time = max(replay.time, due)
            return 1
    replay.time = max(replay.time, deadline)
    return 0


cdef class Replay(TableLink):
    """Replay of a recording: a pcapng or pcap file, or pairs of (sent frame, answer).

    `unmatched` counts frames that have no answer in the recording. The replay treats them like lost
    frames. `first_unmatched` is the first of them; None if there is none.

    Raises:
        DecodeError: The file is damaged or has no answers, or a sent frame is not EtherCAT.
        ValueError: The pairs are invalid.
        OSError: The file cannot be read.
    """
    cdef replay_state replay
    cdef object kept                  # owners of the bytes that the tables point to
    cdef bint is_file

    def __init__(self, recording):
        self.is_file = isinstance(recording, (str, os.PathLike))
        if self.is_file:
            self.name = f"replay of {os.fspath(recording)}"
            exchanges = read_exchanges(recording)
        else:
            self.name = "replay"
            exchanges = [Exchange(*pair) for pair in recording]
        if not exchanges:
            raise self.refusal("the recording contains no frame that came back")
        self.fill(by_question(exchanges), len(exchanges))
        self.table.flags = CAT_LINK_VIRTUAL_TIME
        self.table.self = &self.replay
        self.table.send = replay_send
        self.table.receive = replay_receive
        self.table.now = replay_now
        self.table.wait_until = replay_wait_until

    cdef int fill(self, dict answers, int count) except -1:
        cdef uint32_t slots = 1 << (2 * len(answers)).bit_length()
        cdef uint32_t used = 0
        self.replay.questions = <question *> calloc(slots, sizeof(question))
        self.replay.answers = <answer *> calloc(count, sizeof(answer))
        if self.replay.questions == NULL or self.replay.answers == NULL:
            raise MemoryError(f"cannot allocate memory for {count} answers")
        self.replay.mask = slots - 1
        self.kept = answers
        for asked, exchanges in answers.items():
            used = self.fill_question(asked, exchanges, used)
        return 0

    cdef uint32_t fill_question(self, bytes asked, list exchanges, uint32_t used) except 0:
        """Add a question and its answers, starting at number `used`; return the next free number."""
        cdef uint32_t length = <uint32_t> len(asked)
        cdef question *slot = find(&self.replay, asked, length)
        slot.bytes = asked
        slot.length = length
        slot.hash = hash_of(asked, length)
        slot.first_answer = used
        slot.answer_count = <uint32_t> len(exchanges)
        for exchange in exchanges:
            if not 0 <= exchange.latency_ns <= LATENCY_MAX:
                raise self.refusal(
                    f"an answer after {exchange.latency_ns} ns has a wrong time, must be 0 to 15 min"
                )
            self.fill_answer(&self.replay.answers[used], exchange.sent, exchange.answer)
            self.replay.answers[used].latency_ns = exchange.latency_ns
            used += 1
        return used

    cdef object refusal(self, str what):
        """Return the error for a file, or for pairs."""
        kind = DecodeError if self.is_file else ValueError
        return kind(f"{self.name}: {what}")

    cdef int fill_answer(self, answer *place, bytes sent, bytes reply) except -1:
        if not HEADER_SIZE <= len(reply) <= CAT_FRAME_MAX:
            raise self.refusal(
                f"an answer has {len(reply)} bytes, must have {HEADER_SIZE} to {CAT_FRAME_MAX}"
            )
        if sent[14:16] != reply[14:16]:
            raise self.refusal("the datagrams of an answer differ from those of its question")
        place.bytes = reply
        place.length = <uint32_t> len(reply)
        return 0

    @property
    def answered(self):
        return self.replay.answered

    @property
    def unmatched(self):
        return self.replay.unmatched

    @property
    def first_unmatched(self):
        if self.replay.unmatched == 0:
            return None
        return self.replay.unmatched_frame[:self.replay.unmatched_length]

    def __dealloc__(self):
        free(self.replay.questions)
        free(self.replay.answers)
