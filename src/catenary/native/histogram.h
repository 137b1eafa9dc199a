/* Histogram of times [ns] or counts in fixed memory. It contains no pointers, so it can be placed in
 * memory that processes share. It has one writer. A reader may see a partly added value.
 *
 * Every number below 512 has its own bucket. From 512 on, each octave has 256 buckets, so the
 * error of a percentile is at most 0.4 %. Adding a value takes a few nanoseconds and touches two
 * cache lines. Values of 2^41 and above count in the last bucket.
 */
#ifndef CATENARY_HISTOGRAM_H
#define CATENARY_HISTOGRAM_H

#include <math.h>
#include <stdint.h>

#define CAT_OCTAVE_BITS 8             /* log2 of the buckets per octave */
#define CAT_OCTAVES 33                /* up to 2^41: 36 minutes in ns */
#define CAT_BUCKETS ((CAT_OCTAVES + 1) << CAT_OCTAVE_BITS)

typedef struct cat_histogram {
    uint64_t count;
    int64_t first;                    /* deviations are summed relative to it, which avoids cancellation */
    int64_t low;
    int64_t high;
    double sum;
    double sum_of_squares;
    uint64_t buckets[CAT_BUCKETS];
} cat_histogram;

static inline uint32_t cat_histogram_bucket(uint64_t value) {
    if (value < (2u << CAT_OCTAVE_BITS)) return (uint32_t)value;
    int shift = 63 - __builtin_clzll(value) - CAT_OCTAVE_BITS;
    if (shift >= CAT_OCTAVES) return CAT_BUCKETS - 1;
    return (uint32_t)(((uint64_t)shift << CAT_OCTAVE_BITS) + (value >> shift));
}

/* Return the lowest value of a bucket. */
static inline int64_t cat_histogram_edge(uint32_t bucket) {
    if (bucket < (2u << CAT_OCTAVE_BITS)) return bucket;
    int shift = (int)(bucket >> CAT_OCTAVE_BITS) - 1;
    return ((int64_t)bucket - ((int64_t)shift << CAT_OCTAVE_BITS)) << shift;
}

/* Add a value; a negative value counts as 0. */
static inline void cat_histogram_add(cat_histogram *h, int64_t value) {
    if (value < 0) value = 0;
    if (h->count == 0) h->first = h->low = h->high = value;
    else if (value < h->low) h->low = value;
    else if (value > h->high) h->high = value;
    double deviation = (double)(value - h->first);
    h->sum += deviation;
    h->sum_of_squares += deviation * deviation;
    h->buckets[cat_histogram_bucket((uint64_t)value)]++;
    h->count++;
}

/* Return the percentile for a `fraction` from 0 to 1: the middle of its bucket, limited to the
 * lowest and highest values. The histogram must not be empty. */
static inline double cat_histogram_percentile(const cat_histogram *h, double fraction) {
    uint64_t rank = (uint64_t)(fraction * (double)(h->count - 1) + 0.5), below = 0;
    for (uint32_t k = 0; k < CAT_BUCKETS; k++) {
        below += h->buckets[k];
        if (below <= rank) continue;
        double middle = (double)(cat_histogram_edge(k) + cat_histogram_edge(k + 1) - 1) / 2.0;
        return fmin(fmax(middle, (double)h->low), (double)h->high);
    }
    return (double)h->high;
}

static inline double cat_histogram_mean(const cat_histogram *h) {
    return (double)h->first + h->sum / (double)h->count;
}

static inline double cat_histogram_deviation(const cat_histogram *h) {
    double mean = h->sum / (double)h->count;
    return sqrt(fmax(h->sum_of_squares / (double)h->count - mean * mean, 0.0));
}

#endif
