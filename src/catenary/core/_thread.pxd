from libc.stdint cimport uint32_t, uint64_t
from posix.types cimport pid_t

cdef extern from "<pthread.h>" nogil:
    ctypedef struct pthread_t:
        pass

cdef extern from *:
    """
    #include <pthread.h>
    #include <sched.h>
    typedef struct cat_scheduling {
        int policy;
        int priority;
        cpu_set_t cpus;
    } cat_scheduling;
    """
    ctypedef struct cat_scheduling:
        int policy
        int priority

ctypedef void (*body_t)(void *argument) noexcept nogil

cdef struct thread_t:
    pthread_t handle
    pid_t owner                # process that owns the thread
    body_t body
    void *argument
    int priority               # SCHED_FIFO priority; 0: unchanged
    int cpu                    # -1: unchanged
    int priority_error         # errno of the request for the priority; 0: granted
    int cpu_error              # errno of the request for the CPU; 0: granted
    int policy                 # policy obtained
    int obtained               # priority obtained
    uint32_t started           # futex word
    uint32_t stop              # request to end
    uint32_t ended
    int running
    uint64_t page_faults       # page faults of the body; complete after thread_join

cdef int thread_start(thread_t *t) noexcept nogil
cdef void thread_join(thread_t *t) noexcept nogil
cdef void thread_schedule(thread_t *t) noexcept nogil
cdef int scheduling_save(cat_scheduling *saved) noexcept nogil
cdef void scheduling_restore(const cat_scheduling *saved) noexcept nogil
cdef object scheduling_text(const thread_t *t)
