"""The mutex between threads. Killed owners: see scenario 73_client_killed_with_the_mutex."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from catenary.errors import ShareError
from catenary.share import Mutex
from tests.share.names import mutex_file

COUNTS = 2000


def test_only_one_thread_at_a_time_holds_the_mutex(name: str) -> None:
    inside = [0]
    most = 0

    def work() -> None:
        nonlocal most
        mutex = Mutex(name)
        for _ in range(COUNTS):
            with mutex:
                inside[0] += 1
                most = max(most, inside[0])
                inside[0] -= 1

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (most, inside) == (1, [0])


def test_second_acquire_and_release_without_lock_fail(name: str) -> None:
    mutex = Mutex(name)
    with mutex, pytest.raises(RuntimeError, match="already"):
        mutex.acquire()
    with pytest.raises(RuntimeError, match="this thread does not"):
        mutex.release()


def test_acquire_times_out(name: str) -> None:
    with Mutex(name) as mutex:
        got = []
        other = threading.Thread(target=lambda: got.append(Mutex(name).acquire(timeout=0.01)))
        other.start()
        other.join()
    assert got == [False]
    assert mutex.acquire(timeout=0.0)
    assert not mutex.recovered
    mutex.release()


def test_mutex_of_an_ended_thread_is_recovered(name: str) -> None:
    mutex = Mutex(name)
    thread = threading.Thread(target=mutex.acquire)
    thread.start()
    thread.join()
    with mutex:
        assert mutex.recovered
    with mutex:
        assert not mutex.recovered


def test_file_exists_until_unlink(name: str) -> None:
    path = mutex_file(name)
    Mutex(name, mode=0o660)
    assert path.stat().st_mode & 0o777 == 0o660
    Mutex(name, mode=0o660).unlink()
    assert not path.exists()


def test_file_without_a_mutex_is_refused(name: str) -> None:
    mutex_file(name).write_bytes(bytes(4096))
    mutex_file(name).chmod(0o600)
    with pytest.raises(ShareError, match="mutex of this version"):
        Mutex(name)


OWNER = """
import sys
from catenary.share import Mutex
with Mutex(sys.argv[1]):
    print("mine", flush=True)
    sys.stdin.readline()
"""


def test_owner_inherits_the_priority_of_its_waiter(name: str) -> None:
    """Read the priority of the owner in /proc: field 18 is negative for real time, proc(5)."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    except PermissionError:
        pytest.skip("no SCHED_FIFO here")
    with subprocess.Popen(
        [sys.executable, "-c", OWNER, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as owner:
        assert owner.stdin is not None
        assert owner.stdout is not None
        assert owner.stdout.readline() == b"mine\n"
        assert priority_of(owner.pid) >= 0
        waiter = threading.Thread(target=wait_urgently, args=(name,))
        waiter.start()
        lent = wait_for_priority(owner.pid, below=0)
        owner.stdin.write(b"\n")
        owner.stdin.close()
        waiter.join()
        assert lent == -11


def wait_urgently(name: str) -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))  # of this thread
    with Mutex(name):
        pass


def wait_for_priority(pid: int, *, below: int) -> int:
    pause = threading.Event()
    for _ in range(2000):
        if priority_of(pid) < below:
            break
        pause.wait(0.01)
    return priority_of(pid)


def priority_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[15])
