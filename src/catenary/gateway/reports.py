"""Reports of the gateway: answers to clients, events of writes, and the log of refusals."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from catenary.bus import MainDevice, SubDevice
from catenary.bus.event_types import GatewayWrite
from catenary.errors import DecodeError
from catenary.gateway.clients import Client
from catenary.gateway.limits import GatewayCounts
from catenary.gateway.refusal import Refusal
from catenary.gateway.request import Request
from catenary.remote.limits import RateLimit
from catenary.wire import coe, foe
from catenary.wire.abort import abort_code
from catenary.wire.mailbox import Mailbox, Type, decode_error

log = logging.getLogger("catenary.gateway")

DATA_KEPT = 16  # [bytes] of the written data in an event
LOG_RATE, LOG_BURST = 1.0, 10.0  # refusals in the log per second, and after a pause


class Reports:
    """Receiver of the results of all queues. Any thread may call it."""

    def __init__(self, main: MainDevice, counts: GatewayCounts) -> None:
        self.deliver: Callable[[Client, list[Mailbox]], None] = _discard  # the service replaces it
        self._main = main
        self._counts = counts
        self._limit = RateLimit(LOG_RATE, LOG_BURST)
        self._lock = threading.Lock()  # for the counters and the limit

    def refused(self, sub: SubDevice | None, client: Client, refusal: Refusal) -> None:
        """Count and log a refused message.

        Args:
            sub: The device; None if there is none.
            client: The client.
            refusal: The reason.
        """
        with self._lock:
            self._counts.refused += 1
            logged = self._limit.wait_for(time.monotonic()) == 0
        if logged:
            where = "" if sub is None else f"{sub.station}: "
            log.warning("%s refused: %s%s", client, where, refusal.text)

    def written(
        self, sub: SubDevice, client: Client, request: Request, answer: Mailbox | str
    ) -> None:
        """Put the event of a write.

        Args:
            sub: The device.
            client: The client.
            request: First message of the write.
            answer: Last answer of the device, or the result as text.
        """
        with self._lock:
            self._counts.writes += 1
        result = answer if isinstance(answer, str) else result_text(answer)
        message = f"{sub.station}: {request.what} through the gateway by {client}: {result}"
        if not self._main.is_open:
            return log.warning("%s", message)
        event = GatewayWrite(
            self._main.link.now() * 1e-9,
            sub,
            message,
            peer=str(client),
            what=request.what,
            result=result,
            index=request.index,
            subindex=request.subindex,
            data=request.data[:DATA_KEPT],
        )
        self._main.events.put(event)


def _discard(_client: Client, _answers: list[Mailbox]) -> None:
    """Drop answers: the gateway is closed."""


def result_text(answer: Mailbox) -> str:
    """Return the result that the last answer of a device reports: "done", or its error."""
    try:
        match answer.type:
            case Type.ERROR:
                return f"mailbox error: {decode_error(answer.data).text}"
            case Type.COE:
                found = coe.decode_coe(answer.data)
                if isinstance(found, coe.Abort):
                    return f"SDO abort 0x{found.code:08X}: {abort_code(found.code).text}"
            case Type.FOE:
                message = foe.decode_foe(answer.data)
                if isinstance(message, foe.Error):
                    return f"FoE error 0x{message.code:04X} {message.text}".strip()
    except DecodeError:
        return "invalid answer"
    return "done"
