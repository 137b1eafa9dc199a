"""`realtime.session()`: its changes, their reversal, and refused settings."""

from __future__ import annotations

import subprocess
import sys

import pytest

from catenary.realtime import session

STATE = """
import gc, os, sys
from catenary.realtime import session
from catenary.realtime.system import libc
from catenary.realtime.system.scheduling import locked_kilobytes

def state():
    held = any(os.readlink(f"/proc/self/fd/{n}") == "/dev/cpu_dma_latency"
               for n in os.listdir("/proc/self/fd") if os.path.exists(f"/proc/self/fd/{n}"))
    return (gc.isenabled(), gc.get_freeze_count() > 0, round(sys.getswitchinterval(), 7),
            libc.timer_slack_ns(), held, locked_kilobytes() > 0)

"""
REFUSE = """
def refuse(*_):
    raise OSError(1, "Operation not permitted")
from catenary.realtime.system import preparation
preparation.lock_all_memory = refuse
"""


def in_another_process(code: str) -> list[str]:
    """Run code in another process, and return the lines that it prints."""
    done = subprocess.run(
        [sys.executable, "-c", STATE + code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_all_changes_are_undone():
    before, inside, after = in_another_process(
        "print(state())\n"
        "with session(best_effort=True, switch_interval=2e-4) as s:\n"
        "    print(state()[:4], s.refusals, state()[4:])\n"
        "print(state())"
    )
    assert before == after
    assert inside.startswith("(False, True, 0.0002, 1)")
    assert "locked memory refused" in inside or inside.endswith("True)")


def test_all_changes_are_undone_after_an_exception():
    before, after = in_another_process(
        "print(state())\n"
        "try:\n"
        "    with session(best_effort=True): raise KeyError\n"
        "except KeyError: print(state())"
    )
    assert before == after


def test_nested_sessions():
    outer, inner, again = in_another_process(
        "with session(best_effort=True):\n"
        "    print(state())\n"
        "    with session(best_effort=True): print(state())\n"
        "    print(state())"
    )
    assert outer == inner == again


def test_a_refused_setting_is_an_error_with_a_hint():
    before, message, after = in_another_process(
        REFUSE + "from catenary.errors import RealtimeError\n"
        "print(state())\n"
        "try:\n"
        "    with session(): pass\n"
        "except RealtimeError as error: print(' '.join(str(error).split()))\n"
        "print(state())"
    )
    assert "locked memory refused (Operation not permitted)" in message
    assert "setcap" in message
    assert "memlock" in message
    assert "best_effort=True" in message
    assert before == after


def test_best_effort_lists_refused_settings():
    [refusals] = in_another_process(
        REFUSE + "with session(best_effort=True) as s: print(s.refusals[-1])"
    )
    assert refusals == "locked memory refused (Operation not permitted)"


def test_no_page_faults_in_the_prepared_heap():
    """Allocate 1 MiB 32 times. With separate mappings, each allocation would cause faults."""
    [faults] = in_another_process(
        "import resource\n"
        "def faults(): return resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "with session(best_effort=True, heap_size=8 * 2**20):\n"
        "    bytes(2**20)\n"
        "    before = faults()\n"
        "    for _ in range(32): bytearray(b'x') * 2**20\n"
        "    print(faults() - before)"
    )
    assert int(faults) < 256  # one allocation has this many pages


def test_a_session_cannot_be_entered_twice():
    [said] = in_another_process(
        "with session(best_effort=True) as s:\n"
        "    try: s.__enter__()\n"
        "    except RuntimeError as error: print(error)"
    )
    assert said == "this session is already active; create one session for each `with` block"


@pytest.mark.parametrize("wrong", [{"heap_size": -1}, {"switch_interval": 0.0}])
def test_refuses(wrong):
    with pytest.raises(ValueError, match=r"must not be negative: -1|switch_interval 0"):
        session(**wrong)
