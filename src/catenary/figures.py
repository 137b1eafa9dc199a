"""Names of the statistics of a time, in the column order of all tables."""

FIGURES = ("mean", "max", "min", "sd", "p50", "p99", "p999")
HEADINGS = {"p999": "p99.9"}  # headings that differ from the name


def heading(figure: str) -> str:
    """Return the heading of a figure's column."""
    return HEADINGS.get(figure, figure)
