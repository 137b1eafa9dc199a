"""EthernetPort: Ethernet frames of one device, in a thread that sends and receives them."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeAlias, TypeVar

from catenary.bus.pending import Pending
from catenary.bus.thread_priority import step_behind
from catenary.errors import CatenaryError, DecodeError, LoopError
from catenary.procedure.eoe import pump, room_to
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox_channel import MailboxChannel
from catenary.procedure.mailbox_swap import Outgoing
from catenary.wire.eoe import FRAME_NUMBERS, Fragment, TimeStamp, decode_eoe
from catenary.wire.eoe_frames import MAX_FRAME, MIN_FRAME, FrameAssembler, fragments_of
from catenary.wire.mailbox import Mailbox, Type

T = TypeVar("T")

QUEUE_MAX = 64  # frames that wait to be sent to a device
TURNS_MAX = 32  # mailbox messages in a row, before other devices have their turn
BUSY_PAUSE = 0.2e-3  # [s] between two procedures; without a loop, other threads use the link then
IDLE_PAUSE, IDLE_PAUSE_MAX = 1e-3, 10e-3  # [s] between two checks while no frame moves
RETRY_PAUSE = 0.5  # [s] after a failure
REPORT_INTERVAL = 1.0  # [s] between two reports of one device
CANCEL_CHECK = 0.05  # [s] between two checks whether the port is closed

FULL, SILENT, TAP_DOWN = "queue full", "the device does not answer", "TAP interface down or deleted"
LOST, INVALID = "EtherCAT frames lost", "invalid EoE message"
WRONG_SIZE = "too short or too long for an Ethernet frame"


class PortDevice(Protocol):
    """Interface to the device of a port; `SubDevice` implements it."""

    @property
    def position(self) -> int: ...

    @property
    def channel(self) -> MailboxChannel | None: ...

    @property
    def in_boot(self) -> bool: ...


class PortMain(Protocol):
    """Interface to its MainDevice."""

    @property
    def is_open(self) -> bool: ...

    def request(self, procedure: Procedure[T]) -> Pending[T]: ...


# Receives the new drops of a device by reason, and its present failure, if any.
Report: TypeAlias = Callable[["Counter[str]", CatenaryError | None], object]


@dataclass(slots=True)
class EthernetCounts:
    """Statistics of one device. Sizes are those of Ethernet frames without their checksum."""

    frames_to_device: int = 0
    bytes_to_device: int = 0
    frames_from_device: int = 0
    bytes_from_device: int = 0
    dropped: Counter[str] = field(default_factory=Counter)  # frames or fragments, by reason


class EthernetPort:
    """Owner of the thread that moves Ethernet frames between one device and its receiver.

    `send` may be called in any thread. Received frames are passed to `receive`, also in the thread
    of the acyclic queue, so it must not wait.
    """

    def __init__(
        self,
        sub: PortDevice,
        main: PortMain,
        receive: Callable[[EthernetPort, bytes], bool],
        slots: threading.Semaphore,
        report: Report,
    ) -> None:
        """Initialise the port.

        Args:
            sub: The device.
            main: Its MainDevice.
            receive: Function that receives the frames; it returns False if it dropped one.
            slots: Limit of the ports that use the acyclic frames at the same time.
            report: Function that reports drops, at most once per second.
        """
        self.sub = sub
        self.error: CatenaryError | None = None  # last failure; None after a success
        self._main = main
        self._receive = receive
        self._slots = slots
        self._report = report
        self._counts = EthernetCounts()
        self._lock = threading.Lock()  # for the drops, which several threads count
        self._channel: MailboxChannel | None = None
        self._assembler = FrameAssembler()
        self._frames: deque[bytes] = deque()
        self._fragments: deque[Outgoing] = deque()  # of the frame that is being sent
        self._sending = b""
        self._number = 0
        self._report_due = 0.0
        self._reported: Counter[str] = Counter()
        self._wake = threading.Event()  # set when a frame waits, and at the end
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="catenary eoe", daemon=True)

    @property
    def counts(self) -> EthernetCounts:
        """Copy of the present statistics."""
        with self._lock:
            return replace(self._counts, dropped=Counter(self._counts.dropped))

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread, and stop receiving frames. Waiting frames are discarded."""
        self._ended.set()
        self._wake.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()
        self._unsubscribe()

    def send(self, frame: bytes) -> bool:
        """Queue a frame for the device. Return False if the queue is full."""
        if len(self._frames) >= QUEUE_MAX:
            self._drop(FULL)
            return False
        if not MIN_FRAME <= len(frame) <= MAX_FRAME:
            self._drop(WRONG_SIZE)
            return True
        self._frames.append(frame)
        self._wake.set()
        return True

    def report_tap_down(self) -> None:
        """Count a drop, so that the failure of the receiver is reported."""
        self._drop(TAP_DOWN)

    # -- messages to the device: the interface `Source` of `pump`

    def next(self) -> Outgoing | None:
        """Return the first waiting fragment; None if there is none."""
        if self._ended.is_set():
            return None
        if not self._fragments and self._frames and self._channel is not None:
            self._sending = self._frames.popleft()
            parts = fragments_of(self._sending, self._number, room_to(self._channel))
            self._number = (self._number + 1) % FRAME_NUMBERS
            self._fragments.extend(Outgoing(Type.EOE, part.encode()) for part in parts)
        return self._fragments[0] if self._fragments else None

    def done(self, outgoing: Outgoing) -> None:
        """Remove a fragment that was sent. Drop the frame of one that is given up."""
        if outgoing.given_up:
            self._drop(LOST)
            self._fragments.clear()
            return
        if self._fragments:  # else the port was closed
            self._fragments.popleft()
        if not self._fragments:
            self._counts.frames_to_device += 1
            self._counts.bytes_to_device += len(self._sending)

    # -- messages from the device

    def _take(self, message: Mailbox, time_ns: int) -> bool:
        """Receive a message of the device; the subscriber of its mailbox."""
        try:
            decoded = decode_eoe(message.data)
        except DecodeError:
            self._drop(INVALID)
            return True
        if not isinstance(decoded, Fragment):
            return isinstance(decoded, TimeStamp)  # no frame requests one
        frame = self._assembler.add(decoded, time_ns)
        if self._assembler.drops:
            for reason, count in self._assembler.drops.items():
                self._drop(reason.value, count)
            self._assembler.drops.clear()
        if frame is not None and self._receive(self, frame):
            self._counts.frames_from_device += 1
            self._counts.bytes_from_device += len(frame)
        elif frame is not None:
            self._drop(TAP_DOWN)
        return True

    def _drop(self, reason: str, count: int = 1) -> None:
        with self._lock:
            self._counts.dropped[reason] += count

    def _subscribe(self) -> MailboxChannel | None:
        """Receive the messages of the device's present mailbox."""
        channel = None if self.sub.in_boot else self.sub.channel
        if channel is not self._channel:
            self._unsubscribe()
            self._assembler.reset()
            self._fragments.clear()
            self._channel = channel
        if channel is not None:
            channel.subscribers[Type.EOE] = self._take
        return channel

    def _unsubscribe(self) -> None:
        channel, self._channel = self._channel, None
        if channel is not None and channel.subscribers.get(Type.EOE) == self._take:
            del channel.subscribers[Type.EOE]

    # -- thread

    def _serve(self) -> None:
        step_behind()
        try:
            self._exchange()
        except Exception as error:
            if self._main.is_open:  # else it was closed in another thread
                self.error = CatenaryError(
                    f"the thread of the Ethernet port ended: {error!r}",
                    hint="this is a fault of Catenary: report it, with the traceback on stderr",
                )
                raise

    def _exchange(self) -> None:
        """Exchange frames until the port is closed."""
        pause = IDLE_PAUSE
        while not self._ended.is_set():
            try:
                moved = self._move()
            except LoopError:  # it has ended: the next attempt needs no loop
                self._ended.wait(IDLE_PAUSE_MAX)
                continue
            except CatenaryError as error:
                self._fail(error)
                self._report_drops()
                self._ended.wait(RETRY_PAUSE)  # a waiting frame does not shorten this pause
                continue
            pause = BUSY_PAUSE if moved else min(2 * max(pause, IDLE_PAUSE), IDLE_PAUSE_MAX)
            self._report_drops()
            self._wake.wait(pause)
            self._wake.clear()

    def _move(self) -> bool:
        """Run the exchange with the device once. Return True if a message moved."""
        channel = self._subscribe()
        if channel is None:
            return False
        with self._slots:
            pending = self._main.request(pump(channel, self, TURNS_MAX))
            while not pending.wait(CANCEL_CHECK):
                if self._ended.is_set():
                    pending.cancel()
                    return False
        moved = pending.result()
        self.error = None
        return moved

    def _fail(self, error: CatenaryError) -> None:
        """Discard the waiting frames: they would be old after the failure."""
        # At first, the device may have refused a frame that has left the queue.
        lost = max(len(self._frames) + bool(self._fragments), self.error is None)
        self.error = error
        self._frames.clear()
        self._fragments.clear()
        if lost:
            self._drop(SILENT, lost)

    def _report_drops(self) -> None:
        dropped = self.counts.dropped
        new = dropped - self._reported
        if new and time.monotonic() >= self._report_due and self._main.is_open:
            self._report_due = time.monotonic() + REPORT_INTERVAL
            self._reported = dropped
            self._report(new, self.error)
