"""Machine from an ENI file: its requests, its variables, and its text as a machine file."""
