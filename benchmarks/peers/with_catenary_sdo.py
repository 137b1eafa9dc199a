"""Catenary, while other threads read objects of all devices without a pause."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator, Sequence

import catenary as cat
from catenary.bench.job import Job, Round
from catenary.bench.python_loop import measure, opened

IDENTITY, SERIAL = 0x1018, 4  # the object that the storm reads


def run(job: Job) -> Round:
    with opened(job) as (loop, arm), storm(arm.subs) as answers:
        return measure(loop, arm, job, answers)


@contextlib.contextmanager
def storm(subs: Sequence[cat.SubDevice]) -> Iterator[list[int]]:
    """Run one thread per device that reads one object repeatedly, and yield the answer counts.

    The threads run on the other processors, as in an application with a reserved processor.
    """
    answers = [0] * len(subs)
    stop = threading.Event()
    here = os.sched_getaffinity(0)
    elsewhere = os.sched_getaffinity(os.getppid()) - here or here  # CPUs of the benchmark's process

    def ask(rank: int) -> None:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, elsewhere)
        while not stop.is_set():
            try:
                subs[rank].sdo.read(IDENTITY, SERIAL, type=cat.types.UDINT)
                answers[rank] += 1
            except cat.CatenaryError:
                if not stop.is_set():  # after the last cycle, requests are not sent
                    raise

    threads = [threading.Thread(target=ask, args=(rank,)) for rank in range(len(subs))]
    for thread in threads:
        thread.start()
    try:
        yield answers
    finally:
        stop.set()
        for thread in threads:
            thread.join()
