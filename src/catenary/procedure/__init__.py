"""Conversations with devices, as generators without I/O, clock or retries."""
