/* What a controller counts time with: a crystal whose frequency is off by a constant and swings
 * slowly with the temperature, and the scatter of the time stamps taken by it.
 *
 * The count between two instants is a closed expression: a crystal costs nothing while nobody looks. */
#ifndef CATENARY_VIRTUAL_CRYSTAL_H
#define CATENARY_VIRTUAL_CRYSTAL_H

#include <math.h>
#include <stdint.h>

typedef struct {
    double error;                    /* of the frequency, as a share of it */
    double swing;                    /* greatest share that the temperature adds or takes */
    double turn;                     /* angular frequency of that [rad/ns], 0: none */
    double scatter;                  /* time stamps lie within so much [ns] */
    uint64_t random;                 /* state of the generator of the scatter */
} crystal;

/* How fast the crystal counts at `when`: 1 is right. */
static inline double crystal_rate(const crystal *x, int64_t when) {
    double swing = x->turn > 0 ? x->swing * sin(x->turn * (double)when) : 0;
    return 1.0 + x->error + swing;
}

/* What the crystal counts between two instants of the segment's clock [ns]. */
static inline double crystal_count(const crystal *x, int64_t from, int64_t to) {
    double counted = (double)(to - from) * (1.0 + x->error);
    if (x->turn > 0)
        counted += x->swing / x->turn * (cos(x->turn * (double)from) - cos(x->turn * (double)to));
    return counted;
}

/* Uniform, half of the scatter either way; the same in every run (xorshift64*, Marsaglia 2003, Vigna 2016). */
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
