from libc.stdint cimport int64_t, uint32_t, uint64_t

cdef extern from "histogram.h" nogil:
    enum:
        CAT_BUCKETS
    ctypedef struct histogram_t "cat_histogram":
        uint64_t count
        int64_t low
        int64_t high
        uint64_t buckets[1]
    void histogram_add "cat_histogram_add"(histogram_t *h, int64_t value)
    int64_t cat_histogram_edge(uint32_t bucket)
    double cat_histogram_percentile(const histogram_t *h, double fraction)
    double cat_histogram_mean(const histogram_t *h)
    double cat_histogram_deviation(const histogram_t *h)

cdef void histogram_reset(histogram_t *h) noexcept nogil
cdef dict histogram_summary(const histogram_t *h)
cdef list histogram_counts(const histogram_t *h)
