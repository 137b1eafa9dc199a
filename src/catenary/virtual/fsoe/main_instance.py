"""MainInstance of a simplified safety connection (endpoint.py)."""

from __future__ import annotations

import struct

from catenary.virtual.fsoe.endpoint import Endpoint, SafetyFault, SafetyState
from catenary.wire.fsoe import FsoeCommand

COMMANDS = {
    SafetyState.SESSION: FsoeCommand.SESSION,
    SafetyState.CONNECTION: FsoeCommand.CONNECTION,
    SafetyState.PARAMETER: FsoeCommand.PARAMETER,
}


class MainInstance:
    """MainInstance, which starts the connection and sends the safe outputs.

    Args:
        size: Safety data in a frame, 1 or an even number [bytes].
        connection_id: Connection ID, which must be unique in the network.
        address: Safety address of the SubInstance.
        watchdog_ns: Watchdog time of both ends [ns].
    """

    def __init__(self, size: int, connection_id: int, address: int, watchdog_ns: int) -> None:
        self._end = Endpoint(size)
        self._connection_id, self._address = connection_id, address
        self._watchdog_ns = watchdog_ns
        self._session = 0
        self._rest: list[bytes] = []  # parts of the present state that are not sent yet
        self.outputs = bytes(size)  # requested safe outputs
        self.inputs = bytes(size)  # safe inputs; zeros unless the connection is in DATA
        self.state = SafetyState.RESET
        self.faults: list[str] = []
        self._reset()

    @property
    def frame(self) -> bytes:
        """Frame to send."""
        return self._end.sent

    def step(self, now_ns: int, frame: bytes) -> None:
        """Process the frame that the device holds at present. The result is in `frame`."""
        try:
            if self._end.is_new(frame):
                self._take(now_ns, frame)
            if self.state != SafetyState.RESET:
                self._end.check(now_ns)
        except SafetyFault as fault:
            if self.state != SafetyState.RESET:
                self.faults.append(str(fault))
                self._reset()

    def _reset(self) -> None:
        self.state = SafetyState.RESET
        self._rest = []
        self.inputs = bytes(len(self.inputs))
        self._end.restart()
        self._end.send(FsoeCommand.RESET, b"")

    def _take(self, now_ns: int, frame: bytes) -> None:
        if self.state != SafetyState.RESET and frame[:1] == bytes([FsoeCommand.RESET]):
            raise SafetyFault("reset by the SubInstance")
        pdu = self._end.receive(frame)
        self._end.feed(now_ns, self._watchdog_ns)
        if self.state == SafetyState.DATA:
            process = pdu.command == FsoeCommand.PROCESS_DATA
            self.inputs = pdu.data if process else bytes(len(pdu.data))
            self._end.send(FsoeCommand.PROCESS_DATA, self.outputs)
            return
        wanted = COMMANDS.get(self.state, FsoeCommand.RESET)
        if pdu.command != wanted:
            raise SafetyFault(f"command 0x{pdu.command:02X}, not 0x{wanted:02X}")
        self._go_on()

    def _go_on(self) -> None:
        """Send the next part of the start-up, or the first process data."""
        if not self._rest:
            self.state = SafetyState(self.state + 1)
            if self.state == SafetyState.DATA:
                self._end.send(FsoeCommand.PROCESS_DATA, self.outputs)
                return
            self._rest = self._parts()
            if self.state == SafetyState.CONNECTION:
                self._end.connection_id = self._connection_id
        self._end.send(COMMANDS[self.state], self._rest.pop(0))

    def _parts(self) -> list[bytes]:
        """Return the data of the present state, in parts of one frame each."""
        if self.state == SafetyState.SESSION:
            self._session = self._session % 0xFFFF + 1
            data = struct.pack("<H", self._session)
        elif self.state == SafetyState.CONNECTION:
            data = struct.pack("<HH", self._connection_id, self._address)
        else:
            data = struct.pack("<HH", 2, self._watchdog_ns // 1_000_000)
        size = self._end.size
        return [data[k : k + size] for k in range(0, len(data), size)]
