"""A child that waits: `python -m tests.bench.waits`."""

import signal

print("here", flush=True)
signal.pause()
