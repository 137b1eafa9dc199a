"""Axes and columns: between process images and arrays; owned by Engine."""

class Axes:
    """Owns the axis records and column tables."""

    def __init__(self, plan: object) -> None: ...
