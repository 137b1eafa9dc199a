"""Control laws: Python functions that are checked, compiled, tried, and run in the cycle."""
