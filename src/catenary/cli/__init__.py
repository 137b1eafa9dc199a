"""Command line: one file per command. A command imports its libraries only when it runs."""
