"""Queue of the requests of all clients for one device."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from catenary.bus import MainDevice, SubDevice
from catenary.errors import CatenaryError, ResponseTimeout
from catenary.gateway.clients import Client
from catenary.gateway.exchange import forward
from catenary.gateway.lease import Lease
from catenary.gateway.limits import TURN_TIMEOUT
from catenary.gateway.policy import Policy
from catenary.gateway.refusal import Reason, Refusal, refusal_answer, to_client
from catenary.gateway.reports import Reports
from catenary.gateway.request import Access, Request, read_request
from catenary.gateway.transfer import Transfer, continues, next_transfer
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, send_only
from catenary.wire.mailbox import HEADER_SIZE, Mailbox, Type

log = logging.getLogger("catenary.gateway")


class Outcome(NamedTuple):
    """Result of one message."""

    answers: list[Mailbox]
    refusal: Refusal | None = None


class Job(NamedTuple):
    """One message of a client. Without a client, it ends a transfer in the device."""

    client: Client | None
    request: Request


CLOSED = "the gateway was closed"


class Closing(Exception):
    """The gateway is being closed."""


class DeviceQueue:
    """Owner of the queue of one device, and of the lease of its mailbox.

    `put`, `sweep` and `forget` belong to the thread of the sockets; `run` to a worker.
    """

    def __init__(
        self,
        main: MainDevice,
        position: int,
        policy: Policy,
        reports: Reports,
        schedule: Callable[[Callable[[], None]], None],
        check_open: Callable[[], None],
    ) -> None:
        """Initialise the queue.

        Args:
            main: The MainDevice.
            position: Position of the device.
            policy: Policy of the gateway.
            reports: Receiver of answers, refusals and writes.
            schedule: Function that lets a worker call another one.
            check_open: Function that raises Closing when the gateway is being closed.
        """
        self._main = main
        self._position = position
        self._policy = policy
        self._reports = reports
        self._schedule = schedule
        self._check_open = check_open
        self._lock = threading.Lock()  # for the queue, and the two variables below
        self._queue: deque[Job] = deque()
        self._lease: Lease | None = None  # of a transfer that its client must continue
        self._running = False

    def put(self, client: Client, message: Mailbox) -> None:
        """Queue a message of a client. The limit of each client bounds the queue."""
        self._put(Job(client, read_request(message)))

    def _put(self, job: Job) -> None:
        with self._lock:
            self._queue.append(job)
            if self._running:
                return
            self._running = True
        self._schedule(self.run)

    def sweep(self) -> None:
        """End the transfer of a client that has not continued it in time."""
        lease = self._lease
        if lease is not None and lease.is_due:
            self._end(lease, "the client did not continue")

    def forget(self, client: Client) -> None:
        """Drop the messages of a client that has gone, and end its transfer."""
        with self._lock:
            self._queue = deque(job for job in self._queue if job.client is not client)
        lease = self._lease
        if lease is not None and lease.client is client:
            self._end(lease, "the client has disconnected")

    def close(self) -> None:
        """Drop all messages, and release the mailbox."""
        with self._lock:
            self._queue.clear()
        lease = self._lease
        transfer = None if lease is None else lease.end()
        if lease is not None and transfer is not None:
            self._report_incomplete(lease, transfer, CLOSED)

    def _end(self, lease: Lease, why: str) -> None:
        transfer = lease.end()
        with self._lock:
            if self._lease is lease and transfer is not None:
                self._lease = None
        if transfer is not None:
            self._abandon(lease, transfer, why)

    def _abandon(self, lease: Lease, transfer: Transfer, why: str) -> None:
        """Report a transfer that is not complete, and end it in the device."""
        self._report_incomplete(lease, transfer, why)
        self._put(Job(None, read_request(transfer.end_message)))

    def _report_incomplete(self, lease: Lease, transfer: Transfer, why: str) -> None:
        if transfer.writes and lease.client is not None and self._position < len(self._main.subs):
            sub = self._main.subs[self._position]
            self._reports.written(sub, lease.client, transfer.first, f"not completed: {why}")

    def run(self) -> None:
        """Serve the queue until it is empty, or only messages outside of the transfer are left."""
        while (job := self._next()) is not None:
            try:
                self._serve(job)
            except Closing:
                return
            except Exception:  # a worker has no caller
                log.exception("device %d: request failed", self._position)
                self._answer(job, [])

    def _next(self) -> Job | None:
        with self._lock:
            lease = self._lease
            for job in self._queue:
                if lease is None or job.client is lease.client:
                    self._queue.remove(job)
                    return job
            self._running = False
            return None

    def _serve(self, job: Job) -> None:
        subs, request = self._main.subs, job.request
        if self._position >= len(subs):
            refusal = Refusal(Reason.NO_DEVICE, f"there is no device {self._position}")
            return self._refuse(None, job, refusal)
        sub = subs[self._position]
        channel = sub.file_channel if request.message.type is Type.FOE else _channel(sub)
        if channel is None:
            return self._refuse(sub, job, Refusal(Reason.NO_MAILBOX, f"{sub.station}: no mailbox"))
        if len(request.message.data) + HEADER_SIZE > channel.layout.receive_size:
            return self._refuse(sub, job, Refusal(Reason.TOO_LONG, "larger than the mailbox"))
        lease = self._lease
        if lease is not None and lease.channel is not channel:
            self._end(lease, "the device has another mailbox now")  # such as that of BOOT
        if lease is None or lease.has_ended:
            lease = Lease(channel, job.client)
        self._run_exchange(sub, lease, job)

    def _run_exchange(self, sub: SubDevice, lease: Lease, job: Job) -> None:
        """Run the exchange of one message, and report its result."""
        before = lease.transfer
        try:
            procedure = self._exchange(sub, lease, job)
            outcome = self._main.converse(procedure, self._check_open)
        except Closing:
            lease.end()
            write = written_by(job.request, before)
            if write is not None and job.client is not None and self._policy.permits(sub):
                self._reports.written(sub, job.client, write, f"not completed: {CLOSED}")
            raise
        except Exception as error:  # RuntimeError: the MainDevice was closed
            if not isinstance(error, CatenaryError | RuntimeError):
                log.exception("device %d: request failed", self._position)
            lease.transfer = None
            reason = Reason.NO_ANSWER if isinstance(error, ResponseTimeout) else Reason.FAILED
            outcome = Outcome([], Refusal(reason, str(error).split("\n", 1)[0]))
        following = lease.transfer
        if following is None or lease.has_ended:
            left = lease.end()
            if left is not None:
                self._abandon(lease, left, "its lease has ended")
        with self._lock:
            self._lease = None if lease.has_ended else lease
        self._report(sub, job, before, following, outcome)

    def _exchange(self, sub: SubDevice, lease: Lease, job: Job) -> Procedure[Outcome]:
        """Forward one message if the policy allows it."""
        if not lease.enter():
            return Outcome([], Refusal(Reason.OUT_OF_TURN, "the transfer took too long"))
        transfer, lease.transfer = lease.transfer, None
        try:
            if not (yield from lease.turn(TURN_TIMEOUT)):
                return Outcome([], Refusal(Reason.BUSY, f"{sub.station}: its mailbox is in use"))
            outcome, lease.transfer = yield from self._pass(sub, lease.channel, job, transfer)
            return outcome
        finally:
            lease.leave(keep_turn=self._main.has_loop)

    def _pass(
        self, sub: SubDevice, channel: MailboxChannel, job: Job, transfer: Transfer | None
    ) -> Procedure[tuple[Outcome, Transfer | None]]:
        """Forward one message, in turn. Return its result, and the transfer to continue."""
        request = job.request
        in_turn = continues(transfer, request)
        if request.access in (Access.CONTINUE, Access.END) and not in_turn and job.client:
            refusal = Refusal(Reason.OUT_OF_TURN, f"{request.what}: no transfer to continue")
            return Outcome([], refusal), transfer
        if not in_turn:
            transfer = None  # another transfer begins
        refused = None
        if job.client is not None:
            refused = yield from self._policy.refusal(sub, channel, request, transfer)
        if refused is not None:
            if transfer is not None:
                end = transfer.end_message
                yield from send_only(channel, end.type, end.data)
            return Outcome([], refused), None
        answers = yield from forward(channel, request, transfer)
        return Outcome(answers), next_transfer(transfer, request, answers, channel.layout)

    def _report(
        self,
        sub: SubDevice,
        job: Job,
        before: Transfer | None,
        following: Transfer | None,
        outcome: Outcome,
    ) -> None:
        """Report a completed write or a refusal, and answer the client."""
        if job.client is None:
            return
        request, refusal = job.request, outcome.refusal
        write = written_by(request, before)
        if before is not None and before.writes and write is not before.first:
            self._reports.written(sub, job.client, before.first, "not completed: replaced")
        if refusal is not None:
            tried = refusal.reason in (Reason.NO_ANSWER, Reason.FAILED)
            begun = before is not None and following is None and write is before.first
            if write is not None and (tried or begun):
                self._reports.written(sub, job.client, write, refusal.text)
            return self._refuse(sub, job, refusal)
        if write is not None and following is None:
            last = outcome.answers[-1] if outcome.answers else "ended by the client"
            self._reports.written(sub, job.client, write, last)
        self._answer(job, outcome.answers)

    def _refuse(self, sub: SubDevice | None, job: Job, refusal: Refusal) -> None:
        if job.client is None:
            return
        self._reports.refused(sub, job.client, refusal)
        ends = job.request.access is Access.END  # has no answer
        self._answer(job, [] if ends else [refusal_answer(job.request, refusal)])

    def _answer(self, job: Job, answers: list[Mailbox]) -> None:
        if job.client is not None:
            message = job.request.message
            self._reports.deliver(job.client, [to_client(message, each) for each in answers])


def written_by(request: Request, before: Transfer | None) -> Request | None:
    """Return the request that a message belongs to if it writes; None if it does not write.

    Args:
        request: Message of a client.
        before: Transfer before the message.
    """
    repeated = before is not None and before.first.message.data == request.message.data  # BUSY
    if request.access in (Access.WRITE, Access.OTHER) and not repeated:
        return request
    if request.access is Access.READ or before is None or not before.writes:
        return None
    return before.first


def _channel(sub: SubDevice) -> MailboxChannel | None:
    """Return the present mailbox for protocols other than FoE; None if the device has none."""
    return sub.channel if sub.error is None and not sub.in_boot else None
