"""The command line: one file per command, which imports what it needs only when it runs."""

from catenary.cli.main import main

__all__ = ["main"]
