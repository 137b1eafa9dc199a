"""Linux for real-time programs: scheduling, locked memory, and the preparation of a process."""
