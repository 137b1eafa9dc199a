"""SubInstance of a simplified safety connection (endpoint.py)."""

from __future__ import annotations

import struct

from catenary.virtual.fsoe.endpoint import Endpoint, SafetyFault, SafetyState
from catenary.virtual.fsoe.main_instance import COMMANDS
from catenary.wire.fsoe import FsoeCommand, connection_id_of

LENGTHS = {SafetyState.SESSION: 2, SafetyState.CONNECTION: 4, SafetyState.PARAMETER: 4}
WATCHDOG_NS = 100_000_000  # until the MainInstance has sent the watchdog time


class SubInstance:
    """SubInstance, which answers the MainInstance and sends the safe inputs.

    Args:
        size: Safety data in a frame, 1 or an even number [bytes].
        address: Safety address of the device.
    """

    def __init__(self, size: int, address: int) -> None:
        self._end = Endpoint(size)
        self._address = address
        self._watchdog_ns = WATCHDOG_NS
        self._data = b""  # received in the present state
        self.inputs = bytes(size)  # safe inputs to send
        self.outputs = bytes(size)  # safe outputs; zeros unless the connection is in DATA
        self.state = SafetyState.RESET
        self.faults: list[str] = []

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
                self._end.is_new(frame)  # it has caused the reset, and is not processed again
                self._end.send(FsoeCommand.RESET, b"")

    def _reset(self) -> None:
        self.state = SafetyState.RESET
        self.outputs = bytes(len(self.outputs))
        self._watchdog_ns, self._data = WATCHDOG_NS, b""
        self._end.restart()

    def _take(self, now_ns: int, frame: bytes) -> None:
        if frame[:1] == bytes([FsoeCommand.RESET]):
            self._reset()
            self._end.is_new(frame)
            self._end.receive(frame)
            self._end.send(FsoeCommand.RESET, b"")
            self._begin(now_ns, SafetyState.SESSION)
            return
        if self.state == SafetyState.RESET:
            return  # only a reset begins a connection
        if self.state == SafetyState.CONNECTION and not self._data:
            self._end.connection_id = connection_id_of(frame)
        pdu = self._end.receive(frame)
        self._end.feed(now_ns, self._watchdog_ns)
        if self.state == SafetyState.DATA:
            self._take_data(pdu.command, pdu.data)
        elif pdu.command == COMMANDS[self.state]:
            self._take_part(now_ns, pdu.data)
        else:
            raise SafetyFault(f"command 0x{pdu.command:02X} in {self.state.name}")

    def _begin(self, now_ns: int, state: SafetyState) -> None:
        self.state, self._data = state, b""
        self._end.feed(now_ns, self._watchdog_ns)

    def _take_part(self, now_ns: int, data: bytes) -> None:
        """Echo a part of the start-up, and go on when its data is complete."""
        self._end.send(COMMANDS[self.state], data)
        self._data += data
        length = LENGTHS[self.state]
        if len(self._data) < length:
            return
        words = struct.unpack(f"<{length // 2}H", self._data[:length])
        if self.state == SafetyState.CONNECTION:
            if words != (self._end.connection_id, self._address) or not words[0]:
                raise SafetyFault(f"connection ID and address {words}")
        elif self.state == SafetyState.PARAMETER:
            if words[0] != 2 or not words[1]:
                raise SafetyFault(f"watchdog time {words}")
            self._watchdog_ns = words[1] * 1_000_000
        self._begin(now_ns, SafetyState(self.state + 1))

    def _take_data(self, command: int, data: bytes) -> None:
        if command not in (FsoeCommand.PROCESS_DATA, FsoeCommand.FAIL_SAFE_DATA):
            raise SafetyFault(f"command 0x{command:02X} in DATA")
        self.outputs = data if command == FsoeCommand.PROCESS_DATA else bytes(len(data))
        self._end.send(FsoeCommand.PROCESS_DATA, self.inputs)
