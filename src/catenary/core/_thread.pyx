"""The native thread: SCHED_FIFO, its own CPU, a touched stack, no signals, no GIL.

If the system refuses priority or CPU, the thread runs without it, and `loop.scheduling` reports it.

A forked child has no copy of the thread. `thread_join` returns at once there. The stack pages that
cycles use are wiped instead of copied (native/locked_memory.h). The pages above them hold glibc's
description of the thread, which the child needs. Before the thread ends, it restores the copying:
glibc reuses stacks, and a later thread on this stack may fork.
"""

import errno as error_names

from libc.errno cimport errno
from libc.stdint cimport uint32_t, uint64_t
from posix.unistd cimport getpid

from catenary.core._native cimport (
    cat_futex_wait,
    cat_futex_wake,
    cat_load_acquire32,
    cat_store_release32,
)

cdef extern from *:
    """
    #include <pthread.h>
    #include <sched.h>
    #include <signal.h>
    #include <stdint.h>
    #include <sys/mman.h>
    #include <sys/prctl.h>
    #include <sys/resource.h>
    #include <unistd.h>

    #define STACK_SIZE (512 * 1024)
    #define STACK_TOUCHED (128 * 1024)

    typedef struct stack_part {
        char *start;
        size_t size;
    } stack_part;

    /* Fault in the pages now rather than in a cycle. Return those that are whole and below the
     * frame of the caller; a forked child finds zeros in them. */
    static __attribute__((noinline)) stack_part touch_stack(void) {
        volatile char pages[STACK_TOUCHED];
        uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
        uintptr_t start = ((uintptr_t)pages + page - 1) / page * page;
        uintptr_t end = ((uintptr_t)pages + STACK_TOUCHED) / page * page;
        for (unsigned i = 0; i < STACK_TOUCHED; i += 1024) pages[i] = 0;
        stack_part part = {(char *)start, end - start};
        madvise(part.start, part.size, MADV_WIPEONFORK);
        return part;
    }

    static void keep_stack(stack_part part) { madvise(part.start, part.size, MADV_KEEPONFORK); }

    /* Create a thread that blocks all signals, so that Python's threads receive them. */
    static int create_thread(pthread_t *handle, void *(*body)(void *), void *argument) {
        pthread_attr_t attributes;
        sigset_t all, before;
        int rc = pthread_attr_init(&attributes);
        if (rc) return rc;
        pthread_attr_setstacksize(&attributes, STACK_SIZE);
        sigfillset(&all);
        pthread_sigmask(SIG_SETMASK, &all, &before);
        rc = pthread_create(handle, &attributes, body, argument);
        pthread_sigmask(SIG_SETMASK, &before, 0);
        pthread_attr_destroy(&attributes);
        return rc;
    }

    static int set_priority(int priority) {
        struct sched_param parameters = {.sched_priority = priority};
        return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
    }

    static int set_cpu(int cpu) {
        cpu_set_t cpus;
        if (cpu >= CPU_SETSIZE) return EINVAL;
        CPU_ZERO(&cpus);
        CPU_SET(cpu, &cpus);
        return pthread_setaffinity_np(pthread_self(), sizeof cpus, &cpus);
    }

    static void obtained_scheduling(int *policy, int *priority) {
        struct sched_param parameters;
        pthread_getschedparam(pthread_self(), policy, &parameters);
        *priority = parameters.sched_priority;
    }

    static int save_scheduling(cat_scheduling *saved) {
        obtained_scheduling(&saved->policy, &saved->priority);
        return pthread_getaffinity_np(pthread_self(), sizeof saved->cpus, &saved->cpus);
    }

    static void restore_scheduling(const cat_scheduling *saved) {
        struct sched_param parameters = {.sched_priority = saved->priority};
        pthread_setschedparam(pthread_self(), saved->policy, &parameters);
        pthread_setaffinity_np(pthread_self(), sizeof saved->cpus, &saved->cpus);
    }

    /* The ordinary scheduler delays the end of a wait by up to 50 us by default. */
    static void sharpen_timers(void) { prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL); }

    /* Minor and major page faults of the calling thread. */
    static uint64_t page_faults_here(void) {
        struct rusage used;
        if (getrusage(RUSAGE_THREAD, &used)) return 0;
        return (uint64_t)used.ru_minflt + (uint64_t)used.ru_majflt;
    }
    """
    int SCHED_FIFO
    int SCHED_RR
    ctypedef struct stack_part:
        pass
    stack_part touch_stack() nogil
    void keep_stack(stack_part part) nogil
    int create_thread(pthread_t *handle, void *(*body)(void *) noexcept nogil, void *argument) nogil
    int pthread_join(pthread_t handle, void **result) nogil
    int set_priority(int priority) nogil
    int set_cpu(int cpu) nogil
    void obtained_scheduling(int *policy, int *priority) nogil
    int save_scheduling(cat_scheduling *saved) nogil
    void restore_scheduling(const cat_scheduling *saved) nogil
    void sharpen_timers() nogil
    uint64_t page_faults_here() nogil

cdef enum:
    START_TIMEOUT_NS = 5_000_000_000


cdef void thread_schedule(thread_t *t) noexcept nogil:
    """Request priority and CPU for the calling thread, and record the result."""
    t.priority_error = set_priority(t.priority) if t.priority > 0 else 0
    t.cpu_error = set_cpu(t.cpu) if t.cpu >= 0 else 0
    sharpen_timers()
    obtained_scheduling(&t.policy, &t.obtained)


cdef void *thread_body(void *argument) noexcept nogil:
    cdef thread_t *t = <thread_t *>argument
    cdef uint64_t before
    cdef stack_part stack = touch_stack()
    thread_schedule(t)
    cat_store_release32(&t.started, 1)
    cat_futex_wake(&t.started)
    before = page_faults_here()
    t.body(t.argument)
    t.page_faults += page_faults_here() - before
    keep_stack(stack)
    cat_store_release32(&t.ended, 1)
    return NULL


cdef int thread_start(thread_t *t) noexcept nogil:
    """Start the thread and wait until its scheduling is set. Return 0 or -errno."""
    cdef int rc
    t.started = 0
    t.stop = 0
    t.ended = 0
    rc = create_thread(&t.handle, thread_body, t)
    if rc != 0:
        return -rc
    t.running = 1
    t.owner = getpid()
    while not cat_load_acquire32(&t.started):
        cat_futex_wait(&t.started, 0, START_TIMEOUT_NS)
    return 0


cdef void thread_join(thread_t *t) noexcept nogil:
    """End the thread and wait for it; a no-op in a forked child, which has no copy of it."""
    if t.running and t.owner == getpid():
        cat_store_release32(&t.stop, 1)
        pthread_join(t.handle, NULL)
    t.running = 0


cdef int scheduling_save(cat_scheduling *saved) noexcept nogil:
    return save_scheduling(saved)


cdef void scheduling_restore(const cat_scheduling *saved) noexcept nogil:
    restore_scheduling(saved)


cdef object refused(str what, int error):
    if not error:
        return ""
    name = error_names.errorcode.get(error, str(error))
    return f"{what}: {'not permitted' if name == 'EPERM' else 'refused'} ({name})"


cdef object scheduling_text(const thread_t *t):
    """Return the scheduling as text: "SCHED_FIFO 80, CPU 1"."""
    if t.policy == SCHED_FIFO:
        text = f"SCHED_FIFO {t.obtained}"
    elif t.policy == SCHED_RR:
        text = f"SCHED_RR {t.obtained}"
    else:
        text = refused("SCHED_OTHER", t.priority_error) or "SCHED_OTHER"
    if t.cpu >= 0:
        text += f", {refused(f'CPU {t.cpu}', t.cpu_error) or f'CPU {t.cpu}'}"
    return text
