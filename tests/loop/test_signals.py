"""Ctrl-C and SIGTERM: raised while the loop runs, deferred while it is being left."""

import os
import signal
import threading

import pytest

from catenary.loop.signals import SignalGuard


def leave(guard: SignalGuard, number: int) -> str:
    """Stands for the function that leaves a loop: a signal comes while it is on the stack."""
    os.kill(os.getpid(), number)
    return "left"


@pytest.fixture
def guard() -> SignalGuard:
    return SignalGuard((leave.__code__,))


def test_ctrl_c_is_raised_while_the_loop_runs(guard: SignalGuard) -> None:
    guard.install()
    try:
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        guard.restore()
    assert not guard.hurry


def test_sigterm_becomes_system_exit(guard: SignalGuard) -> None:
    guard.install()
    try:
        with pytest.raises(SystemExit) as caught:
            os.kill(os.getpid(), signal.SIGTERM)
    finally:
        guard.restore()
    assert caught.value.code == 143


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_leaving_shortens_the_waits(guard: SignalGuard, number: int) -> None:
    guard.install()
    try:
        assert leave(guard, number) == "left"
    finally:
        guard.restore()
    assert guard.hurry


def test_a_handler_of_the_application_is_called(guard: SignalGuard) -> None:
    seen: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: seen.append(number))
    try:
        guard.install()
        os.kill(os.getpid(), signal.SIGTERM)
        guard.restore()
        assert seen == [signal.SIGTERM]
        assert signal.getsignal(signal.SIGTERM) is not before
    finally:
        signal.signal(signal.SIGTERM, before)


def test_the_former_handlers_are_restored(guard: SignalGuard) -> None:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    guard.install()
    assert signal.getsignal(signal.SIGINT) is not before[signal.SIGINT]
    guard.restore()
    assert {number: signal.getsignal(number) for number in before} == before


def test_ignored_signals_stay_ignored(guard: SignalGuard) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        guard.install()
        os.kill(os.getpid(), signal.SIGINT)
        guard.restore()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_no_handlers_outside_the_main_thread(guard: SignalGuard) -> None:
    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=guard.install)
    thread.start()
    thread.join()
    assert signal.getsignal(signal.SIGINT) is before
