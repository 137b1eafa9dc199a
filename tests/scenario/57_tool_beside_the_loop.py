"""A vendor's tool reads the whole dictionary of a drive through the gateway while the drive moves.
The program reads objects at the same time. Each receives its own answers, and no cycle is lost.
"""

import struct
import threading

import pytest

import catenary as cat
from tests.gateway.line import CONTENT, Line
from tests.gateway.tool import COE, Aborted, Tool


def read_dictionary(tool: Tool) -> dict[int, str]:
    """Return the names of all objects, by index."""
    names = {}
    for index in tool.object_list():
        request = struct.pack("<HBxHH", 0x8000, 3, 0, index)
        answer = tool.ask(COE, request)
        assert answer.data[6:8] == struct.pack("<H", index)
        names[index] = answer.data[12:].decode("latin-1")
    return names


@pytest.mark.parametrize("udp", [False, True], ids=["TCP", "UDP"])
def test_a_tool_reads_the_dictionary_while_the_drive_moves(udp: bool) -> None:
    with Line() as line, cat.Gateway(line.main, port=0) as gateway:
        line.gateway = gateway
        expected = {each.index: each.name for each in line.main.subs[1].sdo.list()}
        results: list[object] = []

        def work() -> None:
            try:
                with line.tool(udp=udp) as tool:
                    results.append(read_dictionary(tool))
                    results.append(tool.read_file("log"))
                    tool.download(0x6065, 0, bytes(4))
            except Aborted as refusal:
                results.append(refusal.code)

        arm, sub = line.arm(), line.main.subs[1]
        thread = threading.Thread(target=work)
        with cat.Loop(arm, period=1e-3) as loop:
            move = arm.move_by(0.5)
            thread.start()
            own = sub.sdo.request(0x1008)
            answers = 0
            for _ in loop:
                if own.done:
                    assert own.result().decode() == sub.name
                    answers += 1
                    own = sub.sdo.request(0x1008)
                if not thread.is_alive():
                    break
            loop.wait(move)
            assert loop.timing.counters["lost"] == 0
            assert line.servos[0].drive_state() == "OPERATION ENABLED"
        thread.join()
        assert answers > 1
        assert results == [expected, CONTENT, 0x08000021]
        assert line.writes == []
