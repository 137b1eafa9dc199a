"""Motion words of the desk; private to the core."""
