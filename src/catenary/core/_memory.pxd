cdef extern from "locked_memory.h" nogil:
    ctypedef struct cat_memory:
        pass
    ctypedef struct cat_memory_state:
        size_t locked
        size_t touched
        int error

    void *cat_memory_take(cat_memory *memory, size_t count, size_t size)
    void cat_memory_settle(cat_memory *memory)
    void cat_memory_touch(cat_memory *memory)
    void cat_memory_add_state(const cat_memory *memory, cat_memory_state *sum)
    void cat_memory_free(cat_memory *memory)

cdef void *memory_take(cat_memory *memory, size_t count, size_t size) except NULL
cdef object memory_text(const cat_memory_state *state)
