"""Log and histograms of a cycle; private to the core."""
