def hold() -> None:
    """Block the signals that end a program, in this thread."""

def release() -> None:
    """Give the thread the mask that it had before `hold`; a no-op without one."""
