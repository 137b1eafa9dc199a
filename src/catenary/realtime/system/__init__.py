"""Linux settings for real-time programs: scheduling, memory, and preparation of a process."""
