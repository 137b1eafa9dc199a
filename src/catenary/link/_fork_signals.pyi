def hold() -> None:
    """Block the signals that end a program, in this thread."""

def release() -> None:
    """Restore the signal mask that the thread had before `hold`; a no-op without `hold`."""
