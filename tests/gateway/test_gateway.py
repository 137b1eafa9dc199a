"""A foreign tool reads and writes through the gateway, without a loop."""

from __future__ import annotations

import struct
import threading

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.gateway import device_queue
from catenary.virtual.faults import MailboxSilent
from tests.gateway.line import CONTENT, Line
from tests.gateway.tool import COE, EOE, ERROR, FOE, SOE, Aborted, Tool

both = pytest.mark.parametrize("udp", [False, True], ids=["TCP", "UDP"])
BLOB = 0x2100
NOT_ALLOWED, NO_TRANSFER, MISSING = 0x08000021, 0x05040001, 0x06020000


@both
def test_objects_are_read(line: Line, udp: bool) -> None:
    with line.tool(udp=udp) as tool:
        for _ in range(20):  # more than the counters of the mailbox
            assert tool.upload(0x1018, 1) == line.main.subs[1].identity.vendor.to_bytes(4, "little")
        assert tool.upload(0x1008).decode() == line.main.subs[1].name


@both
def test_a_segmented_upload(line: Line, udp: bool) -> None:
    with line.tool(udp=udp) as tool:
        value = tool.upload(BLOB)
    assert len(value) > 10 * 128
    assert value == line.main.subs[1].sdo.read(BLOB)


@both
def test_the_dictionary_is_listed(line: Line, udp: bool) -> None:
    with line.tool(udp=udp) as tool:
        found = tool.object_list()
    assert found == [each.index for each in line.main.subs[1].sdo.list()]
    assert len(found) > 60  # several fragments


@both
def test_a_file_is_read(line: Line, udp: bool) -> None:
    with line.tool(udp=udp) as tool:
        assert tool.read_file("log") == CONTENT
        assert tool.upload(0x1018, 4) == bytes(4)
        assert tool.read_file("log") == CONTENT


def test_addresses_of_this_master_and_of_twincat(line: Line) -> None:
    for address in (0x1002, 0x1003, 1002, 1003):
        with line.tool(address=address) as tool:
            assert tool.upload(0x1018, 4) == bytes(4)


@pytest.mark.parametrize("address", [0, 1, 0x1004, 0xFFFF])
def test_a_device_that_does_not_exist(line: Line, address: int) -> None:
    with line.tool(address=address) as tool:
        with pytest.raises(Aborted) as caught:
            tool.upload(0x1018, 1)
        assert (caught.value.kind, caught.value.code) == (COE, MISSING)


def test_a_device_without_a_mailbox(line: Line) -> None:
    with line.tool(address=0x1001) as tool, pytest.raises(Aborted) as caught:
        tool.upload(0x1018, 1)
    assert caught.value.code == 0x08000022


def test_errors_of_the_device_are_forwarded(line: Line) -> None:
    with line.tool() as tool:
        with pytest.raises(Aborted) as caught:
            tool.upload(0x5FFF)
        assert (caught.value.kind, caught.value.code) == (COE, MISSING)
        with pytest.raises(Aborted) as caught:
            tool.read_file("nothing")
        assert (caught.value.kind, caught.value.code) == (FOE, 0x8001)
        with pytest.raises(Aborted) as caught:
            tool.ask(SOE, bytes(10))
        assert (caught.value.kind, caught.value.code) == (ERROR, 2)


def test_a_write_is_an_event(line: Line) -> None:
    with line.tool() as tool:
        tool.download(0x6065, 0, struct.pack("<I", 4711))
        assert tool.upload(0x6065) == struct.pack("<I", 4711)
        peer = tool.peer
    [event] = line.writes
    assert event.sub is line.main.subs[1]
    assert (event.peer, event.index, event.subindex) == (peer, 0x6065, 0)
    assert (event.data, event.result) == (struct.pack("<I", 4711), "done")
    assert peer in event.message
    assert "SDO download 0x6065:00" in event.message


def test_a_write_that_the_device_refuses_is_an_event(line: Line) -> None:
    with line.tool() as tool, pytest.raises(Aborted):
        tool.download(0x1018, 1, bytes(4))
    [event] = line.writes
    assert event.result.startswith("SDO abort 0x0601")


def test_a_segmented_download_is_one_event(line: Line) -> None:
    with line.tool() as tool:
        tool.begin_download(0x6065, 0, 4)
        tool.segment(struct.pack("<I", 99), last=True)
        assert tool.upload(0x6065) == struct.pack("<I", 99)
    [event] = line.writes
    assert (event.index, event.result) == (0x6065, "done")


def test_a_file_is_written(line: Line) -> None:
    with line.tool() as tool:
        tool.write_file("parameters", CONTENT)
        assert tool.read_file("parameters") == CONTENT
    assert line.servos[0].store.files["parameters"] == CONTENT
    [event] = line.writes
    assert (event.what, event.result) == ("FoE write 'parameters'", "done")


def test_without_permission_nothing_is_written(line: Line) -> None:
    present = line.main.subs[2].sdo.read(0x6065)
    with line.tool(address=0x1003) as tool:
        for write in (
            lambda: tool.download(0x6065, 0, bytes(4)),
            lambda: tool.download(0x1C12, 0, bytes(1), complete=True),
            lambda: tool.begin_download(0x6065, 0, 4),
        ):
            with pytest.raises(Aborted) as caught:
                write()
            assert (caught.value.kind, caught.value.code) == (COE, NOT_ALLOWED)
        with pytest.raises(Aborted) as caught:
            tool.write_file("x", b"x")
        assert (caught.value.kind, caught.value.code) == (FOE, 0x800A)
        for kind in (1, EOE, SOE, 15):
            with pytest.raises(Aborted) as caught:
                tool.ask(kind, bytes(10))
            assert (caught.value.kind, caught.value.code) == (ERROR, 4)
        assert tool.upload(0x6065) == present != bytes(4)
    assert line.gateway.counts.refused == 8
    assert line.writes == []


def test_messages_that_are_not_parsed_count_as_writes(line: Line) -> None:
    with line.tool(address=0x1003) as tool:
        for data in (b"", b"\x00", bytes(2), struct.pack("<H", 5 << 12) + bytes(8), b"\xff" * 10):
            with pytest.raises(Aborted) as caught:
                tool.ask(COE, data)
            assert caught.value.kind == ERROR
        with pytest.raises(Aborted) as caught:
            tool.ask(FOE, b"\x77" * 10)
        assert caught.value.kind == ERROR


def test_a_segment_without_a_transfer(line: Line) -> None:
    with line.tool() as tool:
        with pytest.raises(Aborted) as caught:
            tool.segment(bytes(4), last=True)
        assert caught.value.code == NO_TRANSFER
        with pytest.raises(Aborted) as caught:
            tool.ask(FOE, struct.pack("<BxI", 3, 1) + b"data")
        assert (caught.value.kind, caught.value.code) == (FOE, 0x8004)
    assert line.writes == []


def test_a_segment_does_not_continue_the_transfer_of_another_client(line: Line) -> None:
    with line.tool() as first, line.tool() as second:
        first.begin_download(0x6065, 0, 4)
        with pytest.raises(Aborted) as caught:  # after the lease of the first one
            second.segment(bytes(4), last=True)
        assert caught.value.code == NO_TRANSFER
        assert second.upload(0x6065) != bytes(4)
    [event] = line.writes
    assert event.result == "not completed: the client did not continue"


def test_clients_take_turns(line: Line) -> None:
    results: list[bytes] = []

    def read() -> None:
        with line.tool() as tool:
            results.extend(tool.read_file("log") for _ in range(3))

    threads = [threading.Thread(target=read) for _ in range(4)]
    for thread in threads:
        thread.start()
    for _ in range(20):  # transfers of the program itself
        assert line.main.subs[1].sdo.read(0x1018, 4) == bytes(4)
    for thread in threads:
        thread.join()
    assert results == [CONTENT] * 12


def test_a_client_that_leaves_its_transfer(line: Line) -> None:
    with line.tool() as tool:
        next(tool.file_packets("log", 116))
    with line.tool() as tool:
        assert tool.read_file("log") == CONTENT
    assert line.main.subs[1].foe.read("log") == CONTENT


def test_a_device_that_does_not_answer(line: Line) -> None:
    line.segment.inject(MailboxSilent(1))
    with line.tool() as tool:
        for _ in range(2):
            with pytest.raises(Aborted) as caught:
                tool.upload(0x1018, 1)
            assert (caught.value.kind, caught.value.code >> 24) in ((COE, 5), (COE, 8))
        with pytest.raises(Aborted):
            tool.download(0x6065, 0, bytes(4))
    [event] = line.writes
    assert "device 1" in event.result
    with line.tool(address=0x1003) as tool:
        assert tool.upload(0x1018, 4) == bytes(4)


def test_an_unexpected_error_does_not_block_the_device(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    with line.tool() as tool:
        tool.begin_download(0x6065, 0, 4)
        with monkeypatch.context() as patch:
            patch.setattr(device_queue, "forward", lambda *_: 1 // 0)
            with pytest.raises(Aborted) as caught:
                tool.segment(bytes(4), last=True)
        assert caught.value.code == 0x08000000
        with line.tool() as other:
            assert other.upload(0x1018, 4) == bytes(4)
    [event] = line.writes
    assert "division" in event.result


def test_a_write_that_close_ends_is_an_event(line: Line) -> None:
    with line.tool() as tool:
        tool.begin_download(0x6065, 0, 4)
        line.gateway.close()
    [event] = line.writes
    assert event.result == "not completed: the gateway was closed"


def test_only_loopback_addresses(line: Line) -> None:
    for address in ("0.0.0.0", "192.168.1.5", "::"):
        with pytest.raises(ValueError, match="SSH tunnel"):
            cat.Gateway(line.main, address=address)
    with pytest.raises(ValueError, match="not an IP address"):
        cat.Gateway(line.main, address="robot")


def test_a_port_in_use(line: Line) -> None:
    with pytest.raises(ConfigurationError, match=f"port {line.gateway.port}"):
        cat.Gateway(line.main, port=line.gateway.port).open()


def test_wrong_positions(line: Line) -> None:
    with pytest.raises(ValueError, match="the segment has 3 devices"):
        cat.Gateway(line.main, write=[3], port=0).open()
    with pytest.raises(ValueError, match="negative"):
        cat.Gateway(line.main, write=[-1])
    assert cat.Gateway(line.main, write=[line.main.subs[2]]).writable == {2}


def test_after_close_the_port_is_free(line: Line) -> None:
    port = line.gateway.port
    with line.tool() as tool:
        tool.upload(0x1018, 1)
        assert line.gateway.clients == (tool.peer,)
        line.gateway.close()
        line.gateway.close()
        with pytest.raises((ConnectionError, OSError)):
            tool.upload(0x1018, 1)
    with cat.Gateway(line.main, port=port) as again, Tool(again.port) as tool:
        assert tool.upload(0x1018, 4) == bytes(4)
