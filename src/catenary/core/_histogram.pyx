# cython: boundscheck=False, wraparound=False, cdivision=True
"""Histograms of times [ns] in fixed memory: log-linear buckets, exact mean, deviation and extremes.

Up to 512 ns every nanosecond has its bucket, then 256 buckets share an octave, so a percentile is
wrong by at most 0.4 %. Adding takes a few nanoseconds and one cache line.
"""

from libc.math cimport sqrt
from libc.stdint cimport int64_t, uint32_t, uint64_t
from libc.stdlib cimport free, calloc
from libc.string cimport memset

cdef extern from *:
    int __builtin_clzll(unsigned long long) noexcept nogil

cdef enum:
    PER_OCTAVE = 256

PERCENTILES = (("p50", 0.5), ("p99", 0.99), ("p999", 0.999))


cdef inline uint32_t bucket_of(uint64_t value) noexcept nogil:
    cdef int shift
    if value < 2 * PER_OCTAVE:
        return <uint32_t>value
    shift = 63 - __builtin_clzll(value) - HALF_OCTAVE_BITS
    if shift >= OCTAVES:
        return BUCKETS - 1
    return <uint32_t>(shift * PER_OCTAVE + (value >> shift))


cdef (int64_t, int64_t) edges_of(uint32_t bucket) noexcept:
    """Lowest value in the bucket, lowest above it."""
    cdef int64_t shift
    cdef int64_t mantissa
    if bucket < 2 * PER_OCTAVE:
        return bucket, bucket + 1
    shift = bucket // PER_OCTAVE - 1
    mantissa = bucket - shift * PER_OCTAVE
    return mantissa << shift, (mantissa + 1) << shift


cdef void histogram_add(histogram_t *h, int64_t value) noexcept nogil:
    cdef double deviation
    if value < 0:
        value = 0
    if h.count == 0:
        h.first = h.low = h.high = value
    elif value < h.low:
        h.low = value
    elif value > h.high:
        h.high = value
    h.count += 1
    deviation = <double>(value - h.first)
    h.sum += deviation
    h.sum_of_squares += deviation * deviation
    h.buckets[bucket_of(<uint64_t>value)] += 1


cdef void histogram_reset(histogram_t *h) noexcept nogil:
    memset(h, 0, sizeof(histogram_t))


cdef double percentile(const histogram_t *h, double fraction) except? -1:
    """The middle of the bucket that holds the value of this rank, within the extremes."""
    cdef uint64_t rank = <uint64_t>(fraction * (h.count - 1) + 0.5)
    cdef uint64_t below = 0
    cdef uint32_t k
    for k in range(BUCKETS):
        below += h.buckets[k]
        if below > rank:
            lower, upper = edges_of(k)
            return min(max((lower + upper - 1) / 2.0, <double>h.low), <double>h.high)
    return <double>h.high


cdef dict histogram_summary(const histogram_t *h):
    if h.count == 0:
        return {"count": 0}
    cdef double mean = h.sum / h.count
    cdef double variance = h.sum_of_squares / h.count - mean * mean
    summary = {
        "count": h.count,
        "mean": (h.first + mean) / 1e3,
        "min": h.low / 1e3,
        "max": h.high / 1e3,
        "sd": sqrt(max(variance, 0.0)) / 1e3,
    }
    for name, fraction in PERCENTILES:
        summary[name] = percentile(h, fraction) / 1e3
    return summary


cdef list histogram_counts(const histogram_t *h):
    counts = []
    cdef uint32_t k
    for k in range(BUCKETS):
        if h.buckets[k]:
            lower, upper = edges_of(k)
            counts.append((lower / 1e3, upper / 1e3, h.buckets[k]))
    return counts


cdef class Histogram:
    """Owns one histogram of its own, for times measured outside the cycle."""
    cdef histogram_t *c

    def __cinit__(self):
        self.c = <histogram_t *>calloc(1, sizeof(histogram_t))
        if self.c == NULL:
            raise MemoryError

    def add(self, int64_t value_ns):
        histogram_add(self.c, value_ns)

    def summary(self):
        return histogram_summary(self.c)

    def counts(self):
        return histogram_counts(self.c)

    def __dealloc__(self):
        free(self.c)
