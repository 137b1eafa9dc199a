# cython: boundscheck=False, wraparound=False, cdivision=True
"""Histograms of times in seconds for Python; native/histogram.h counts in ns."""

from libc.stdint cimport int64_t, uint32_t
from libc.stdlib cimport calloc, free
from libc.string cimport memset

PERCENTILES = (("p50", 0.5), ("p99", 0.99), ("p999", 0.999))


cdef void histogram_reset(histogram_t *h) noexcept nogil:
    memset(h, 0, sizeof(histogram_t))


cdef dict histogram_summary(const histogram_t *h):
    if h.count == 0:
        return {"count": 0}
    summary = {
        "count": h.count,
        "mean": cat_histogram_mean(h) / 1e9,
        "min": h.low / 1e9,
        "max": h.high / 1e9,
        "sd": cat_histogram_deviation(h) / 1e9,
    }
    for name, fraction in PERCENTILES:
        summary[name] = cat_histogram_percentile(h, fraction) / 1e9
    return summary


cdef list histogram_counts(const histogram_t *h):
    counts = []
    cdef uint32_t k
    for k in range(CAT_BUCKETS):
        if h.buckets[k]:
            lower, upper = cat_histogram_edge(k), cat_histogram_edge(k + 1)
            counts.append((lower / 1e9, upper / 1e9, h.buckets[k]))
    return counts


cdef class Histogram:
    """Histogram of times that are measured outside the cycle."""
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
