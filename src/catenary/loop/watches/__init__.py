"""Watches: checks that run while a loop is open, one module for each kind of fault."""
