"""UDP source. The runner uses it in test_rdt_box.py."""

from __future__ import annotations

import select

from catenary.sensors import Udp


class Ready:
    """Poll of a socket that is always ready."""

    def register(self, _socket: object, _events: int) -> None: ...

    def poll(self, _timeout: float) -> list[int]:
        return [1]


def test_a_datagram_that_the_kernel_has_dropped_is_no_data(monkeypatch) -> None:
    monkeypatch.setattr(select, "poll", Ready)
    connection = Udp("127.0.0.1", 9).open()
    assert connection.read(1.0)[0] == b""
    connection.close()
