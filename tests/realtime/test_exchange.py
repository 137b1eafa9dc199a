"""Values and queues between tasks and processes, even if processes are killed."""

from __future__ import annotations

import copy
import os
import signal
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.realtime import Queue, Silence, Task, Tasks, Value
from tests.realtime.bodies import put_forever, write_forever


def test_a_value_is_zeros_until_it_is_written():
    value = Value("f8", 3)
    assert value.number == 0
    assert value.read().tolist() == [0.0, 0.0, 0.0]
    value.write([1.0, 2.0, 3.0])
    value.write(np.arange(3))
    assert value.number == 2
    assert value.read().tolist() == [0.0, 1.0, 2.0]


def test_silence_counts_calls_without_a_new_value():
    value = Value("f8")
    silence = Silence(value)
    assert [silence.look() for _ in range(3)] == [0, 0, 0]
    value.write(1.0)
    assert [silence.look() for _ in range(3)] == [0, 1, 2]
    value.write(1.0)  # an equal value is new, too
    assert [silence.look() for _ in range(2)] == [0, 1]


def test_a_value_can_be_a_scalar_or_a_structure():
    single = Value("i4")
    single.write(7)
    assert single.read() == 7
    pose = Value([("position", "f8", 2), ("valid", "?")])
    pose.write(np.array(([1.0, 2.0], True), pose.read().dtype))
    assert pose.read()["position"].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("wrong", [[1.0, 2.0], [[1.0, 2.0, 3.0]], 1.0, ["a", "b", "c"]])
def test_arrays_of_another_form_are_refused(wrong):
    value, queue = Value("f8", 3), Queue("f8", 3, length=2)
    for use in (value.write, queue.put):
        with pytest.raises(ValueError, match=r"float64 of shape \(3,\)"):
            use(wrong)
    assert (value.number, len(queue)) == (0, 0)


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: Value("O"), TypeError, "Python objects"),
        (lambda: Value("f8", 0), ValueError, "a size of 0 bytes"),
        (lambda: Queue("f8", length=0), ValueError, "length of 0 records"),
        (lambda: Queue("f8", length=4, full="wait"), ValueError, '"refuse" or "overwrite"'),
    ],
)
def test_refuses(make, error, words):
    with pytest.raises(error, match=words):
        make()


def test_a_full_queue_refuses_and_counts_the_newest():
    queue = Queue("i8", length=3)
    assert [queue.put(k) for k in range(5)] == [True, True, True, False, False]
    assert (len(queue), queue.refused, queue.lost) == (3, 2, 0)
    assert [queue.take() for _ in range(4)] == [0, 1, 2, None]


def test_a_full_queue_can_overwrite_the_oldest():
    queue = Queue("i8", length=3, full="overwrite")
    assert all(queue.put(k) for k in range(5))
    assert [queue.take() for _ in range(4)] == [2, 3, 4, None]
    assert (queue.lost, queue.refused) == (2, 0)


@given(st.lists(st.booleans(), max_size=60), st.sampled_from(["refuse", "overwrite"]))
def test_a_queue_keeps_the_order(steps, full):
    """Compare with a list. True puts the next number, False takes one."""
    queue, model, number = Queue("i8", length=4, full=full), [], 0
    for put in steps:
        if not put:
            taken = queue.take()
            assert (None if taken is None else int(taken)) == (model.pop(0) if model else None)
            continue
        number += 1
        accepted = queue.put(number)
        assert accepted == (full == "overwrite" or len(model) < 4)
        model = [*model, number][-4:] if accepted else model
        assert len(queue) == len(model)


def in_a_thread(call) -> list[object]:
    """Return the result or the exception of a call in another thread, which still runs."""
    found, done, looked = [], threading.Event(), threading.Event()

    def body() -> None:
        try:
            found.append(call())
        except RuntimeError as error:
            found.append(str(error))
        done.set()
        looked.wait(10.0)

    thread = threading.Thread(target=body)
    thread.start()
    done.wait(10.0)
    looked.set()
    thread.join()
    return found


def test_only_one_writer_producer_and_consumer():
    value, queue = Value("i8"), Queue("i8", length=4)
    value.write(1)
    queue.put(1)
    queue.take()
    again = copy.copy(value), copy.copy(queue)  # as in another task
    assert "already has a writer" in str(in_a_thread(lambda: again[0].write(2)))
    assert "already has a producer" in str(in_a_thread(lambda: again[1].put(2)))
    assert "already has a consumer" in str(in_a_thread(again[1].take))


def test_a_new_writer_replaces_one_that_ended():
    value = Value("i8")
    [writer] = in_a_thread(lambda: value.write(1) or threading.get_native_id())
    while os.path.exists(
        f"/proc/{writer}"
    ):  # Python's join returns slightly before the thread ends
        threading.Event().wait(0.001)
    successor = copy.copy(value)
    successor.write(2)
    assert successor.read() == 2


def test_read_a_value_of_another_process_that_is_killed():
    """All elements of each array are equal, even after SIGKILL during a write."""
    value = Value("f8", 512)
    task = Task(write_forever, (value,), period=1e-3, on_failure="continue")
    with Tasks(task, workers="processes") as tasks:
        newest = 0.0
        while newest < 3000:
            array = value.read()
            assert array.min() == array.max() >= newest
            newest = float(array[0])
        os.kill(tasks["write_forever"].process, signal.SIGKILL)
        tasks.join(10.0)
    last = value.read()
    assert last.min() == last.max() == value.number
    value.write(np.zeros(512))  # the previous writer was killed
    assert value.read().max() == 0.0


@pytest.mark.parametrize("full", ["refuse", "overwrite"])
def test_take_records_of_another_process_that_is_killed(full):
    """Records are complete and in order, and missing records are counted."""
    queue = Queue("f8", 64, length=8, full=full)
    task = Task(put_forever, (queue,), period=1e-3, on_failure="continue")
    taken, last = 0, 0.0
    with Tasks(task, workers="processes") as tasks:
        while taken < 3000:
            record = queue.take()
            if record is None:
                continue
            assert record.min() == record.max() > last
            last, taken = float(record[0]), taken + 1
        os.kill(tasks["put_forever"].process, signal.SIGKILL)
        tasks.join(10.0)
    while (record := queue.take()) is not None:
        assert record.min() == record.max() > last
        last, taken = float(record[0]), taken + 1
    if full == "overwrite":
        assert taken + queue.lost == last
    assert queue.put(np.zeros(64))  # the previous producer was killed
