"""A client that may command writes anything into the desk: the loop reads it without a fault.

The mutex is left out: the loop never takes it, and clients trust each other.
"""

from __future__ import annotations

import mmap
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.errors import LeaseError, ShareError
from catenary.plan.sink import SinkLayout
from catenary.share.command_table import Desk, geometry, make_desk, open_desk
from catenary.share.commands import CommandReader
from catenary.share.layout import make_layout
from catenary.share.lease import Lease
from catenary.share.process import this_process

SINK = SinkLayout(
    period=1e-3,
    axes=("a", "b", "c"),
    fields=(),
    record_size=8,
    actual_size=8,
    target_size=8,
    utc_offset_ns=0,
    virtual_time=True,
)
LAYOUT = make_layout("desk", SINK, history=0.1, opened=0.0, writer=this_process())
WHERE = geometry(3)
WORDS = st.one_of(
    st.sampled_from([0, 1, 2, 63, 64, 65, 129, 2**31, 2**32, 2**63, 2**64 - 2, 2**64 - 1]),
    st.integers(0, 2**64 - 1),
)
PLACES = st.one_of(
    st.sampled_from([WHERE.closed, WHERE.holders, WHERE.places, WHERE.rings, WHERE.motion]),
    st.integers(WHERE.closed // 8, WHERE.size // 8 - 1).map(lambda word: 8 * word),
)
WRITTEN = st.lists(st.tuples(PLACES, WORDS), min_size=1, max_size=12)


@pytest.fixture(scope="module")
def shared() -> tuple[Desk, mmap.mmap]:
    """A desk, and its memory as a client has it."""
    desk, descriptor = make_desk(LAYOUT)
    memory = mmap.mmap(descriptor, WHERE.size)
    os.close(descriptor)
    return desk, memory


@given(rounds=st.lists(WRITTEN, min_size=1, max_size=3))
@settings(max_examples=300)
def test_the_loop_reads_whatever_is_there(
    shared: tuple[Desk, mmap.mmap], rounds: list[list[tuple[int, int]]]
) -> None:
    desk, memory = shared
    memory[WHERE.closed :] = bytes(WHERE.size - WHERE.closed)
    reader = CommandReader(desk, LAYOUT)
    for written in rounds:
        for at, value in written:
            memory[at : at + 8] = value.to_bytes(8, "little")
        for command in reader.commands():
            assert set(command.axes) <= {0, 1, 2}
        for end in reader.ended():
            assert str(end)


@given(written=WRITTEN)
@settings(max_examples=200)
def test_a_jog_reads_whatever_is_there(
    shared: tuple[Desk, mmap.mmap], written: list[tuple[int, int]]
) -> None:
    desk, memory = shared
    memory[WHERE.closed :] = bytes(WHERE.size - WHERE.closed)
    with Lease(desk, LAYOUT, [0, 2], 3600.0) as lease:
        jog, request = lease.jog(0, 0.1), lease.request("disable")
        for at, value in written:
            if at >= WHERE.motion:
                memory[at : at + 8] = value.to_bytes(8, "little")
        assert jog.status.text
        assert all(status.text for status in request.status)
        jog.release()


def test_a_ring_with_the_largest_number_ends(
    shared: tuple[Desk, mmap.mmap],
) -> None:
    """`for (number = first; number <= last; ...)` never ended for 2^64 - 1."""
    desk, memory = shared
    memory[WHERE.closed :] = bytes(WHERE.size - WHERE.closed)
    Lease(desk, LAYOUT, [0], 3600.0)
    reader = CommandReader(desk, LAYOUT)
    assert reader.commands() == []
    for place in range(16):
        ring = WHERE.rings + place * WHERE.ring_size
        memory[ring : ring + 8] = b"\xff" * 8
    assert reader.commands() == []


@given(written=WRITTEN)
@settings(max_examples=200)
def test_another_client_gets_an_error_in_words(
    shared: tuple[Desk, mmap.mmap], written: list[tuple[int, int]]
) -> None:
    desk, memory = shared
    memory[WHERE.closed :] = bytes(WHERE.size - WHERE.closed)
    for at, value in written:
        memory[at : at + 8] = value.to_bytes(8, "little")
    try:
        with Lease(desk, LAYOUT, [0, 2], 3600.0) as lease:
            lease.send(position=[0.1, 0.2])
    except LeaseError:
        return


def test_memory_that_is_not_sealed_is_refused(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    descriptor = os.memfd_create("open", os.MFD_ALLOW_SEALING)
    os.ftruncate(descriptor, WHERE.size)
    monkeypatch.setattr(
        "catenary.share.command_table.request_descriptor", lambda path, owner: descriptor
    )
    with pytest.raises(ShareError, match="seals 0x0"):
        open_desk(LAYOUT, tmp_path_factory.getbasetemp(), os.geteuid())
