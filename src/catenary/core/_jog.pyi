"""Jogs and requested states of operators; private to the core."""
