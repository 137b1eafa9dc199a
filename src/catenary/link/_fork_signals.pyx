"""Fork hooks that block SIGINT, SIGTERM and SIGHUP in the calling thread during a fork.

They are compiled, because Python runs signal handlers inside Python functions and inside
`signal.pthread_sigmask`. An exception of a handler within a fork hook would be lost, and a program
would continue after Ctrl-C. Here, signals stay blocked until `os.fork` has returned.
"""

cdef extern from *:
    """
    #include <signal.h>

    static __thread sigset_t mask_before;
    static __thread int held;

    static void hold_signals(void) {
        sigset_t ending;
        sigemptyset(&ending);
        sigaddset(&ending, SIGINT);
        sigaddset(&ending, SIGTERM);
        sigaddset(&ending, SIGHUP);
        held = pthread_sigmask(SIG_BLOCK, &ending, &mask_before) == 0;
    }

    static void release_signals(void) {
        if (held) pthread_sigmask(SIG_SETMASK, &mask_before, NULL);
        held = 0;
    }
    """
    void hold_signals() nogil
    void release_signals() nogil


def hold():
    hold_signals()


def release():
    release_signals()
