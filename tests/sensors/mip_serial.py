"""Simulated MicroStrain device at a pseudo terminal: it acknowledges commands."""

from __future__ import annotations

import os
import select
import threading
from types import TracebackType
from typing import Self

from tests.sensors import mip_device as device

BASE_RATE = 0x0E


class Device:
    """Owner of a pseudo terminal, whose path is that of the port, like that of udev."""

    def __init__(self, path: str) -> None:
        self._path = path
        self.commands: list[tuple[int, int]] = []  # descriptor set and command
        self._end = threading.Event()

    def __enter__(self) -> Self:
        self._master, self._slave = os.openpty()
        os.symlink(os.ttyname(self._slave), self._path)
        self._thread = threading.Thread(target=self._answer)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._end.set()
        self._thread.join()
        os.unlink(self._path)
        os.close(self._slave)
        os.close(self._master)

    @property
    def streams(self) -> bool:
        return (0x01, 0x06) in self.commands

    def send(self, data: bytes) -> None:
        os.write(self._master, data)

    def _answer(self) -> None:
        received = b""
        while not self._end.is_set():
            if not select.select([self._master], [], [], 0.01)[0]:
                continue
            received += os.read(self._master, 4096)
            while len(received) >= 6 and len(received) >= (size := received[3] + 6):
                self._acknowledge(received[2], received[5])
                received = received[size:]

    def _acknowledge(self, descriptor_set: int, command: int) -> None:
        rate = [(0x8E, b"\x80\x03\xe8")] if (descriptor_set, command) == (0x0C, BASE_RATE) else []
        self.send(device.reply(descriptor_set, command, 0, *rate))
        self.commands.append((descriptor_set, command))
