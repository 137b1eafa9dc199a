"""Set-points of one axis in one cycle; private to the core."""
