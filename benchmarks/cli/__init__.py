"""Command line of the benchmarks."""
