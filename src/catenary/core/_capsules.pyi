"""C tables passed in capsules; private to the core."""
