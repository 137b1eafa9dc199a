"""Control laws: plain Python functions, checked, compiled, rehearsed, and run in the cycle."""
