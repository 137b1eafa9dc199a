"""Three tasks on one processor: `python three_tasks.py`, in virtual time; `python three_tasks.py
realtime` runs them on this machine's clock.

The tasks of a published experiment execute 3, 5 and 10 ms every 10, 20 and 40 ms. By analysis,
their response times are at most 3, 8 and 29 ms.
"""

import sys

from catenary import realtime


def compute(task: realtime.Running, seconds: float) -> None:
    for _job in task:  # one job per release, until the task is stopped
        task.spend(seconds)  # a real task computes; on a virtual clock, the time is declared


def main(virtual: bool) -> None:
    tau1 = realtime.Task(compute, (3e-3,), name="tau1", period=10e-3, priority=30, cpu=0)
    tau2 = realtime.Task(compute, (5e-3,), name="tau2", period=20e-3, priority=20, cpu=0)
    tau3 = realtime.Task(compute, (10e-3,), name="tau3", period=40e-3, priority=10, cpu=0)
    with realtime.Tasks(
        *(tau1, tau2, tau3),  # each in a separate process
        clock=realtime.VirtualClock() if virtual else None,
        session=realtime.session(best_effort=True),
        best_effort=True,  # without priorities if they are not permitted
    ) as tasks:
        tasks.join(4.0)
        print(tasks)  # times of their jobs
        print(tasks.verdict())  # from the longest measured execution times


if __name__ == "__main__":  # the tasks' processes import this file
    main(virtual="realtime" not in sys.argv[1:])
