"""Control laws: plain Python functions, checked, compiled, tried on copies, run in the cycle."""
