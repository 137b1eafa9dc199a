"""Worker process for one round of one peer: `python -m catenary.bench.worker JOB RESULT`.

Every peer gets the same processor and scheduling. Every round has a new process, so that all peers
start from the same state and the memory of one peer does not affect the timing of another.
"""

from __future__ import annotations

import contextlib
import gc
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from catenary.bench.job import Job, Round, read_job, write_round
from catenary.realtime.system.scheduling import Scheduling, current_scheduling, request_scheduling


def main(arguments: Sequence[str]) -> None:
    job_path, result_path = map(Path, arguments)
    job = read_job(job_path)
    peer: Callable[[Job], Round] = import_module(job.module).run
    with spinning(job) if job.spin else contextlib.nullcontext():
        obtained = schedule(job)
        result = peer(job)
    write_round(replace(result, scheduling=str(obtained)), result_path)
    print("done", flush=True)


def schedule(job: Job) -> Scheduling:
    if job.priority is None:
        return current_scheduling()
    # Lock the memory of the Python peers. The C programs lock their own memory.
    return request_scheduling(priority=job.priority, lock_memory=True, cpu=job.cpu)


@contextlib.contextmanager
def spinning(job: Job) -> Iterator[None]:
    """Run a busy Python thread on the processor of the loop during the block.

    The thread has ordinary scheduling, because it starts before the main thread requests a
    priority.
    """
    stop = threading.Event()

    def spin() -> None:
        if job.cpu is not None:
            os.sched_setaffinity(0, {job.cpu})
        while not stop.is_set():
            sum(range(100))
            if job.storm:
                make_garbage()

    thread = threading.Thread(target=spin, name="spin", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def make_garbage() -> None:
    """Create a thousand objects in reference cycles, and run a full garbage collection."""
    ring: list[object] = []
    ring.extend([ring] for _ in range(1000))
    del ring
    gc.collect()


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except Exception as error:
        # The benchmark process reads this line. The traceback on stderr is for debugging.
        print(f"{type(error).__name__}: {' '.join(str(error).split())}", flush=True)
        raise
