"""The mutex among threads. (Owners that are killed: scenario 73_client_killed_with_the_mutex.)"""

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


def test_one_at_a_time(name: str) -> None:
    there = [0]
    most = 0

    def work() -> None:
        nonlocal most
        mutex = Mutex(name)
        for _ in range(COUNTS):
            with mutex:
                there[0] += 1
                most = max(most, there[0])
                there[0] -= 1

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (most, there) == (1, [0])


def test_a_thread_that_has_it_is_told_so(name: str) -> None:
    mutex = Mutex(name)
    with mutex, pytest.raises(RuntimeError, match="already"):
        mutex.acquire()
    with pytest.raises(RuntimeError, match="does not have"):
        mutex.release()


def test_waiting_has_an_end(name: str) -> None:
    with Mutex(name) as mutex:
        got = []
        other = threading.Thread(target=lambda: got.append(Mutex(name).acquire(timeout=0.01)))
        other.start()
        other.join()
    assert got == [False]
    assert mutex.acquire(timeout=0.0)
    assert not mutex.recovered
    mutex.release()


def test_a_thread_that_ended_with_it_is_recovered_from(name: str) -> None:
    mutex = Mutex(name)
    thread = threading.Thread(target=mutex.acquire)
    thread.start()
    thread.join()
    with mutex:
        assert mutex.recovered
    with mutex:
        assert not mutex.recovered


def test_the_name_stays_until_it_is_taken_away(name: str) -> None:
    path = mutex_file(name)
    Mutex(name, mode=0o660)
    assert path.stat().st_mode & 0o777 == 0o660
    Mutex(name, mode=0o660).unlink()
    assert not path.exists()


def test_a_file_that_is_no_mutex(name: str) -> None:
    mutex_file(name).write_bytes(bytes(4096))
    mutex_file(name).chmod(0o600)
    with pytest.raises(ShareError, match="no mutex"):
        Mutex(name)


OWNER = """
import sys
from catenary.share import Mutex
with Mutex(sys.argv[1]):
    print("mine", flush=True)
    sys.stdin.readline()
"""


def test_a_waiter_lends_its_priority_to_the_owner(name: str) -> None:
    """What the kernel says of the owner: proc(5), field 18: a real-time priority is negative."""
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
