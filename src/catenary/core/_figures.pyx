# cython: boundscheck=False, wraparound=False, cdivision=True
"""Figures of a cycle: the log, a ring of records, and one histogram per phase.

The native thread writes without waiting. A reader copies a record and drops it if the thread has
overwritten it during the copy. Histograms are reset by exchanging them for cleared ones.
"""

from libc.stdint cimport uint8_t, uint32_t, uint64_t

from catenary.core._axis_log cimport axis_log_row, axis_log_row_size
from catenary.core._cycle cimport LOG_MARGIN, PHASES, cycle_t, record_t
from catenary.core._cycle import PHASE_NAMES
from catenary.core._histogram cimport (
    histogram_counts,
    histogram_reset,
    histogram_summary,
    histogram_t,
)
from catenary.core._memory cimport cat_memory_free, memory_take
from catenary.core._native cimport cat_fence, cat_store_release_pointer


cdef class Figures:
    cdef int attach(self, cycle_t *cycle, uint64_t log_cycles, uint32_t log_axes) except -1:
        """Give a cycle its records and histograms. `log_axes`: number of axes to log."""
        self.cycle = cycle
        self.log_cycles = log_cycles
        cycle.records_mask = (1 << (log_cycles + LOG_MARGIN - 1).bit_length()) - 1
        cycle.histograms = <histogram_t *>memory_take(&self.memory, PHASES, sizeof(histogram_t))
        self.spare = <histogram_t *>memory_take(&self.memory, PHASES, sizeof(histogram_t))
        cycle.records = <record_t *>memory_take(
            &self.log_memory, cycle.records_mask + 1, sizeof(record_t)
        )
        if log_axes:
            cycle.axis_log.axes = log_axes
            cycle.axis_log.mask = cycle.records_mask
            cycle.axis_log.row_size = axis_log_row_size(log_axes)
            cycle.axis_log.rows = <uint8_t *>memory_take(
                &self.log_memory, cycle.records_mask + 1, cycle.axis_log.row_size
            )
        return 0

    cdef bytes log(self):
        """Return the last records, oldest first; records of logged axes follow each of them.

        Cycles that are incomplete or were overwritten during the copy are omitted.
        """
        cdef cycle_t *c = self.cycle
        cdef uint64_t last = c.number
        cdef uint64_t number
        cdef record_t record
        found = []
        for number in range(last - min(last, self.log_cycles) + 1, last + 1):
            record = c.records[number & c.records_mask]
            axes = axis_log_row(&c.axis_log, number)
            cat_fence()
            if axes is not None and record.number == number == c.records[number & c.records_mask].number:
                found.append((<char *>&record)[: sizeof(record_t)])
                found.append(axes)
        return b"".join(found)

    cdef dict histograms(self):
        """Return the summary of every phase."""
        return {
            name: histogram_summary(&self.cycle.histograms[phase])
            for name, phase in PHASE_NAMES.items()
        }

    cdef list counts(self, str phase):
        """Return the buckets of one phase."""
        if phase not in PHASE_NAMES:
            raise ValueError(f"phase {phase!r}: must be one of {', '.join(PHASE_NAMES)}")
        return histogram_counts(&self.cycle.histograms[<int>PHASE_NAMES[phase]])

    cdef void reset(self) noexcept:
        """Exchange the histograms, because the native thread may be adding to the old ones."""
        cdef histogram_t *old = self.cycle.histograms
        cdef int phase
        for phase in range(PHASES):
            histogram_reset(&self.spare[phase])
        cat_store_release_pointer(<void **>&self.cycle.histograms, self.spare)
        self.spare = old

    def __dealloc__(self):
        cat_memory_free(&self.memory)
        cat_memory_free(&self.log_memory)
