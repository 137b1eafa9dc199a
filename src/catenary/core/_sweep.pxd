"""Frequency sweeps of jogs, inlined where they are used.

Theory of operation. The velocity is amplitude · edge · sin(phase). The frequency changes by the same
factor in each cycle (logarithmic sweep), from `start` to `end` within `duration`. `turn` is the phase
of one cycle at 1 Hz, integrated over the change of the frequency. `edge` rises from 0 to 1 in the
first 0.1 s, and falls to 0 in the last 0.1 s.

With w = 2π·frequency, the acceleration is at most amplitude · sqrt(w² + bend²): `bend` is the largest
relative rate of change of the edge and of the amplitude, |ln(end/start)|/duration. The amplitude is
reduced where this exceeds the acceleration. Without this, the acceleration limit would clip the sine.

Budget: 25 ns per cycle.
"""

from libc.math cimport M_PI, exp, expm1, fabs, fmax, fmin, fmod, isfinite, log, sin, sqrt

cdef enum:
    EDGES_PER_SECOND = 10              # an edge lasts 0.1 s
    EDGES = 2
    SLOWEST = 1000                     # longest period of the sine [s]

cdef struct sweep_t:
    double duration                    # [s]; 0: no sweep
    double elapsed                     # [s]
    double frequency                   # of this cycle [Hz]
    double growth                      # factor of the frequency per cycle
    double turn                        # phase per cycle at 1 Hz [rad]
    double phase                       # [rad]
    double bend                        # [rad/s]
    double acceleration                # largest one [rad/s²]

cdef inline bint sweep_is_valid(double start, double end, double duration, double period) noexcept nogil:
    """Return True if the sweep has time for its edges, and its frequencies suit the period [s]."""
    if not (duration * EDGES_PER_SECOND >= EDGES and isfinite(duration)):
        return False
    return start * SLOWEST >= 1 and end * SLOWEST >= 1 and fmax(start, end) * period < 0.5

cdef inline void sweep_begin(sweep_t *s, double start, double end, double duration,
                             double acceleration, double period) noexcept nogil:
    """Begin a valid sweep. `acceleration`: largest one [rad/s²]."""
    cdef double rate = log(end / start) / duration
    s.duration = duration
    s.elapsed = 0.0
    s.frequency = start
    s.growth = exp(rate * period)
    s.turn = 2 * M_PI * (period if rate == 0.0 else expm1(rate * period) / rate)
    s.phase = 0.0
    s.bend = EDGES_PER_SECOND + fabs(rate)
    s.acceleration = acceleration

cdef inline bint sweep_is_over(const sweep_t *s) noexcept nogil:
    return s.elapsed >= s.duration

cdef inline double sweep_velocity(sweep_t *s, double velocity, double period) noexcept nogil:
    """Return the velocity of this cycle, and advance by one. `velocity`: signed amplitude [rad/s]."""
    cdef double left = s.duration - s.elapsed
    cdef double edge = fmin(fmin(s.elapsed, left) * EDGES_PER_SECOND, 1.0)
    cdef double w = 2 * M_PI * s.frequency
    cdef double highest = s.acceleration / sqrt(w * w + s.bend * s.bend)
    cdef double sine = sin(s.phase)
    if not left > 0:
        return 0.0
    s.phase = fmod(s.phase + s.frequency * s.turn, 2 * M_PI)
    s.frequency *= s.growth
    s.elapsed += period
    return edge * sine * fmin(fmax(velocity, -highest), highest)
