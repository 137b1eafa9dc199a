"""A child that waits: `python -m tests.benchmarks.waits`."""

import signal

print("here", flush=True)
signal.pause()
