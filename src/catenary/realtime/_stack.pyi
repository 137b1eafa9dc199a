"""The stack of the calling thread, touched: its pages are there before they are needed."""

def touch_stack(size: int) -> None:
    """The next `size` bytes; there must be room for them."""
