# cython: boundscheck=False, wraparound=False, cdivision=True
"""Motion words of the desk (native/motion.h): tokens, heartbeats, and the stop word.

Theory of operation. The core issues a random token every 50 ms, and keeps the last ones with their
times of issue (`tokens`). A heartbeat echoes a token and names its press. It extends a jog until
200 ms after the issue of that token. A token that was issued earlier, or that the core does not
know, extends nothing. All times are read from the link's clock at the same place of the cycle: if
the process of the loop was stopped, all tokens are old afterwards. _jog.pyx moves the axes.

Budget: 40 ns per cycle.
"""

from libc.stdint cimport int64_t, uint32_t, uint64_t
from libc.string cimport memset

from catenary.core._native cimport (
    CAT_MOTION_PRESS_SHIFT,
    CAT_MOTION_TOKEN_MASK,
    cat_load_acquire64,
    cat_motion_slot,
    cat_sink,
    cat_store_release64,
)

cdef enum:
    TOKEN_NS = 50_000_000      # between two tokens
    FRESH_NS = 200_000_000     # after its issue, a token extends a jog for this long


cdef void motion_attach(motion_t *m, const cat_sink *sink, uint32_t axes, uint64_t seed) noexcept nogil:
    """Connect the motion words of a sink, or none, and forget all jogs.

    Words that exist already request nothing. The engine does not run.
    """
    cdef uint32_t i
    memset(m.jogs, 0, axes * sizeof(jog_t))
    memset(m.tokens, 0, sizeof(m.tokens))
    m.words = NULL
    m.allowed = 0
    if sink == NULL or sink.motion == NULL:
        return
    m.words = sink.motion
    m.slots = <cat_motion_slot *>(m.words + 1)
    m.allowed = sink.jog == 1
    m.random = seed
    m.stop_seen = cat_load_acquire64(&m.words.stop)
    for i in range(axes):
        m.jogs[i].press = cat_load_acquire64(&m.slots[i].press)
        m.jogs[i].request = cat_load_acquire64(&m.slots[i].request)


cdef uint64_t next_random(motion_t *m) noexcept nogil:
    """Return the next number of SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom
    number generators", 2014)."""
    cdef uint64_t z
    m.random += 0x9E3779B97F4A7C15ULL
    z = m.random
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL
    return z ^ (z >> 31)


cdef void motion_begin(motion_t *m, int64_t now) noexcept nogil:
    """Begin a cycle at a time of the link's clock. Issue a token if the newest one is 50 ms old."""
    cdef token_t *token = &m.tokens[m.newest]
    m.now = now
    if token.value != 0 and now - token.issued < TOKEN_NS:
        return
    m.newest = (m.newest + 1) % TOKENS
    token = &m.tokens[m.newest]
    token.value = max(next_random(m) & CAT_MOTION_TOKEN_MASK, <uint64_t>1)
    token.issued = now
    cat_store_release64(&m.words.token, token.value)


cdef bint motion_extends(const motion_t *m, uint64_t heartbeat, uint64_t press, int64_t now,
                         int64_t *deadline) noexcept nogil:
    """Return True if a heartbeat belongs to the press and echoes a fresh token.

    `deadline` is then the end of the time that it grants [ns]; otherwise it stays unchanged.
    """
    cdef uint64_t value = heartbeat & CAT_MOTION_TOKEN_MASK
    cdef const token_t *token
    cdef uint32_t k
    if value == 0 or heartbeat >> CAT_MOTION_PRESS_SHIFT != (press & 0xFFFF):
        return False
    for k in range(TOKENS):
        token = &m.tokens[k]
        if token.value == value and 0 <= now - token.issued <= FRESH_NS:
            deadline[0] = token.issued + FRESH_NS
            return True
    return False


cdef bint motion_stop_requested(motion_t *m) noexcept nogil:
    """Return True if the stop word has changed since the last call."""
    cdef uint64_t stop
    if m.words == NULL:
        return False
    stop = cat_load_acquire64(&m.words.stop)
    if stop == m.stop_seen:
        return False
    m.stop_seen = stop
    return True
