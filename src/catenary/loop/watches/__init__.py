"""Watches: the checks of a session in every cycle, one module for each kind of fault."""
