"""Memory of the cycle, from the allocator of native/locked_memory.h, and its state as text."""

import errno as error_names
import resource

KILO, MEGA = 1024, 1024 * 1024


cdef void *memory_take(cat_memory *memory, size_t count, size_t size) except NULL:
    """Return `count` zeroed elements of `size` bytes. Raise MemoryError if memory is exhausted."""
    cdef void *part = cat_memory_take(memory, count, size)
    if part == NULL:
        raise MemoryError(f"cannot allocate {count * size} bytes for the cycle")
    return part


def amount(size):
    """Return a number of bytes as text: "1.2 MB"."""
    return f"{size / MEGA:.3g} MB" if size >= MEGA else f"{size / KILO:.3g} kB"


def reason(error):
    """Return the reason why memory is not locked, and a remedy. `error`: errno of mlock."""
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    name = error_names.errorcode.get(error, str(error))
    if limit == resource.RLIM_INFINITY:
        return name
    return f"{name}, RLIMIT_MEMLOCK {amount(limit)}: raise `ulimit -l`, or grant CAP_IPC_LOCK"


cdef object memory_text(const cat_memory_state *state):
    """Return the state as text: "1.2 MB locked", and the amount not locked with its reason."""
    text = f"{amount(state.locked)} locked"
    if state.touched:
        text += f", {amount(state.touched)} touched only ({reason(state.error)})"
    return text
