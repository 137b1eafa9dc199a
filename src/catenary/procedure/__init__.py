"""Conversations with devices as generators: no I/O, no clock, no retry."""
