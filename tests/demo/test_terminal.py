"""Detection of Enter while a program runs."""

from __future__ import annotations

import os
import pty
import threading

from catenary.demo.terminal import on_enter


def test_enter_calls_the_action_and_leaving_does_not_block() -> None:
    person, program = pty.openpty()
    received = threading.Semaphore(0)
    with on_enter(received.release, source=program) as listening:
        assert listening
        for _ in range(2):
            os.write(person, b"\n")
            assert received.acquire(timeout=20)
    os.write(person, b"\n")
    assert not received.acquire(blocking=False)
    os.close(person)
    os.close(program)


def test_letters_are_ignored_and_a_hangup_ends_the_thread() -> None:
    person, program = os.pipe(), threading.Event()
    with on_enter(program.set, source=person[0]) as listening:
        assert listening
        os.write(person[1], b"abc")
        os.close(person[1])
    assert not program.is_set()
    os.close(person[0])


def test_without_a_terminal_nothing_is_read() -> None:
    received = threading.Event()
    with on_enter(received.set) as listening:  # the standard input of pytest is not a terminal
        assert not listening
