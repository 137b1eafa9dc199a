"""While the drives move, objects are read and written: by requests in the loop, and by plain calls
in another thread. No cycle is lost or late. An answer takes four cycles.
A call that would block the loop is refused at once.
"""

import threading

import pytest

import catenary as cat
from catenary.bus import Pending
from catenary.errors import LoopError, SdoAbort
from catenary.types import DINT, UDINT, UINT
from tests.scenario.cell import Cell

RUNS = ("threaded", "inline")
WRITABLE, SCRATCH, LARGE = 0x2101, 0x2102, 0x2100


@pytest.mark.parametrize("run", RUNS)
def test_an_answer_takes_four_cycles(cell: Cell, run: str) -> None:
    arm = cell.drives()
    drive = cell.subs.drives[0]
    answer: Pending[int] | None = None
    with cat.Loop(arm, execution=run) as loop:  # type: ignore[arg-type]
        for cycle in loop:
            if answer is None and cycle.number == 10:
                answer = drive.sdo.request(0x1018, 1, type=UDINT)
                assert not answer.done
            elif answer is not None and answer.done:
                break
        assert cycle.number - 10 <= 4
        assert answer is not None
        assert answer.result() == drive.identity.vendor
        assert loop.timing.counters["lost"] == 0
    cell.assert_safe()


def test_all_drives_answer_in_the_same_four_cycles(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 0:
                answers = [drive.sdo.request(0x1018, 4, type=UDINT) for drive in cell.subs.drives]
            elif all(answer.done for answer in answers):
                break
        assert cycle.number <= 4
    assert [answer.result() for answer in answers] == [1, 2]


def test_an_object_written_in_the_loop_can_be_read_back(cell: Cell) -> None:
    arm = cell.drives()
    drive = cell.subs.drives[0]
    blob = bytes(range(200)) * 3
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 0:
                small = drive.sdo.request_write(SCRATCH, 0, 0xBEEF, type=UINT)
                large = drive.sdo.request_write(WRITABLE, 0, blob)
                back = drive.sdo.request(WRITABLE)
                wrong = drive.sdo.request_write(0x1000, 0, 5, type=UDINT)
            if cycle.number == 400:
                break
        assert loop.timing.counters["lost"] == 0
    assert (small.done, small.error, small.result()) == (True, None, None)
    assert large.result() is None
    assert back.result() == blob
    assert isinstance(wrong.error, SdoAbort)
    with pytest.raises(SdoAbort, match="read-only"):
        wrong.result()
    assert drive.sdo.read(SCRATCH, type=UINT) == 0xBEEF


@pytest.mark.parametrize("run", RUNS)
def test_a_call_that_would_block_the_loop_is_refused_at_once(cell: Cell, run: str) -> None:
    arm = cell.drives()
    drive = cell.subs.drives[0]
    with cat.Loop(arm, execution=run) as loop:  # type: ignore[arg-type]
        for cycle in loop:
            with pytest.raises(RuntimeError, match=r"request\(\)"):
                drive.sdo.read(0x1000)
            with pytest.raises(RuntimeError, match=r"request\(\)"):
                drive.sdo.write(SCRATCH, 0, 5, type=UINT)
            if cycle.number == 3:
                break


def test_another_thread_reads_and_writes(cell: Cell) -> None:
    arm = cell.drives()
    drive = cell.subs.drives[0]
    found: list[object] = []

    def elsewhere() -> None:
        found.append(drive.sdo.read(LARGE))
        drive.sdo.write(SCRATCH, 0, 7, type=UINT)
        found.append(drive.sdo.read(SCRATCH, type=UINT))
        found.append(drive.sdo.read(0x6064, type=DINT) is not None)

    thread = threading.Thread(target=elsewhere)
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 0:
                thread.start()
            if not thread.is_alive():
                break
            thread.join(1e-4)  # virtual time does not wait for that thread, so let it run
        assert loop.timing.counters["lost"] == 0
    assert found == [bytes(k * 7 & 0xFF for k in range(2048)), 7, True]


def test_a_request_is_cancelled_and_the_next_gets_its_own_answer(cell: Cell) -> None:
    arm = cell.drives()
    drive = cell.subs.drives[0]
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 0:
                begun = drive.sdo.request(LARGE)
                waiting = drive.sdo.request_write(SCRATCH, 0, 1, type=UINT)
            if cycle.number == 2:
                for request in (begun, waiting):
                    request.cancel()
                    assert request.done
                    with pytest.raises(RuntimeError, match="cancelled"):
                        request.result()
                after = drive.sdo.request(0x1018, 1, type=UDINT)
            if cycle.number == 200:
                break
    assert after.result() == drive.identity.vendor


def test_the_end_of_the_loop_ends_waiting_calls_with_an_error(cell: Cell) -> None:
    arm = cell.drives()
    drive = cell.subs.drives[0]
    with cat.Loop(arm) as loop:
        next(loop)
        answer = drive.sdo.request(0x1000)
        with pytest.raises(RuntimeError, match="no answer yet"):
            answer.result()
    assert answer.done
    with pytest.raises(LoopError, match="ended"):
        answer.result()
    assert drive.sdo.request(0x1018, 1, type=UDINT).result() == drive.identity.vendor  # without one


def test_two_runs_are_equal() -> None:
    from tests.scenario.cell import cell_of

    def story() -> list[tuple[int, bool]]:
        with cell_of() as cell:
            arm = cell.drives()
            seen = []
            with cat.Loop(arm) as loop:
                for cycle in loop:
                    if cycle.number % 7 == 0:
                        answer = cell.subs.drives[0].sdo.request(LARGE)
                    seen.append((cycle.number, answer.done))
                    if cycle.number == 300:
                        return seen
        return []

    assert story() == story()
