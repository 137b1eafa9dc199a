from libc.stdint cimport int64_t, uint32_t, uint64_t

cdef enum:
    HALF_OCTAVE_BITS = 8                 # 256 buckets an octave: each at most 0.4 % wide
    OCTAVES = 33                         # up to 2^41 ns, 36 minutes
    BUCKETS = (OCTAVES + 1) * 256

cdef struct histogram_t:
    uint64_t count
    int64_t first                        # deviations are summed from it: no cancellation
    int64_t low
    int64_t high
    double sum
    double sum_of_squares
    uint64_t buckets[(33 + 1) * 256]

cdef void histogram_add(histogram_t *h, int64_t value) noexcept nogil
cdef void histogram_reset(histogram_t *h) noexcept nogil
cdef dict histogram_summary(const histogram_t *h)
cdef list histogram_counts(const histogram_t *h)
