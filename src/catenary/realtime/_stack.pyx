"""Pre-fault the stack of the calling thread."""

cdef extern from *:
    """
    #include <alloca.h>
    #include <stddef.h>

    static __attribute__((noinline)) void touch_stack_pages(size_t size) {
        volatile char *pages = alloca(size);
        for (size_t k = 0; k < size; k += 1024) pages[k] = 0;
    }
    """
    void touch_stack_pages(size_t size) nogil


def touch_stack(size_t size):
    touch_stack_pages(size)
