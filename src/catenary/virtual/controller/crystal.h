/* Crystal of a controller: constant frequency error, slow variation with the temperature, and scatter
 * of time stamps.
 *
 * A closed formula gives the count between two times, so a crystal needs no periodic work. */
#ifndef CATENARY_VIRTUAL_CRYSTAL_H
#define CATENARY_VIRTUAL_CRYSTAL_H

#include <math.h>
#include <stdint.h>

typedef struct {
    double error;                    /* relative error of the frequency */
    double swing;                    /* amplitude of the relative change with the temperature */
    double turn;                     /* angular frequency of this change [rad/ns]; 0: none */
    double scatter;                  /* width of the scatter of time stamps [ns] */
    uint64_t random;                 /* state of the random generator for the scatter */
} crystal;

/* Return the rate of the crystal at `when`; 1 is exact. */
static inline double crystal_rate(const crystal *x, int64_t when) {
    double swing = x->turn > 0 ? x->swing * sin(x->turn * (double)when) : 0;
    return 1.0 + x->error + swing;
}

/* Return the time that the crystal counts between two times of the segment's clock [ns]. */
static inline double crystal_count(const crystal *x, int64_t from, int64_t to) {
    double counted = (double)(to - from) * (1.0 + x->error);
    if (x->turn > 0)
        counted += x->swing / x->turn * (cos(x->turn * (double)from) - cos(x->turn * (double)to));
    return counted;
}

/* Return a uniform random number from -scatter/2 to scatter/2. The sequence is the same in every run
 * (xorshift64*, Marsaglia 2003, Vigna 2016). */
static inline int64_t crystal_scatter(crystal *x) {
    if (x->scatter <= 0)
        return 0;
    x->random ^= x->random >> 12;
    x->random ^= x->random << 25;
    x->random ^= x->random >> 27;
    double share = (double)(x->random * 0x2545F4914F6CDD1Dull >> 11) * 0x1p-52 - 1.0;
    return llrint(share * 0.5 * x->scatter);
}

#endif
