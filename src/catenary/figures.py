"""Statistics of a time, in the order of the columns of every table."""

FIGURES = ("mean", "max", "min", "sd", "p50", "p99", "p999")
HEADINGS = {"p999": "p99.9"}  # differs from the name


def heading(figure: str) -> str:
    """Return the heading of a figure's column."""
    return HEADINGS.get(figure, figure)
