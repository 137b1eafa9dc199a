"""Pre-fault the stack of the calling thread."""

def touch_stack(size: int) -> None:
    """Touch the next `size` bytes of the stack, which must have room for them."""
