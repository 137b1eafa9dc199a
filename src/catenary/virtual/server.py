"""Server of a segment on a NIC, for any MainDevice at the other end of the cable."""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import signal
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from types import FrameType
from typing import NamedTuple

from catenary.errors import LinkError
from catenary.interpreter import permission_advice
from catenary.virtual.fault_player import FaultEvent
from catenary.virtual.segment import Segment

ETHERCAT = 0x88A4
SOL_PACKET, PACKET_IGNORE_OUTGOING, PACKET_QDISC_BYPASS = 263, 23, 20
IFF_UP = 1
PR_SET_PDEATHSIG = 1
SIOCGIFFLAGS = 0x8913
SO_TIMESTAMPNS = 35  # asm-generic/socket.h
MAX_AGE = 2e-3  # [s]; SOEM abandons a frame after the same time (EC_TIMEOUTRET)
NEVER_NS = (1 << 63) - 1


def _interface_flags(interface: str) -> int:
    """Return the flags of an interface from the kernel (/sys may show another namespace)."""
    request = struct.pack("16sH14x", interface.encode(), 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as anything:
        try:
            answer = fcntl.ioctl(anything, SIOCGIFFLAGS, request)
        except OSError:
            raise LinkError(
                f"there is no network interface {interface!r}",
                hint="list the interfaces with `ip link`",
            ) from None
    return int(struct.unpack_from("16sH", answer)[1])


def _open_socket(interface: str) -> socket.socket:
    if "/" in interface or not interface or len(interface) > 15:
        raise LinkError(f"invalid network interface name {interface!r}")
    if not _interface_flags(interface) & IFF_UP:
        raise LinkError(f"{interface} is down", hint=f"sudo ip link set {interface} up")
    try:
        packet = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
    except PermissionError:
        raise LinkError(
            f"no permission for raw frames on {interface}", hint=permission_advice()
        ) from None
    try:
        packet.setsockopt(SOL_PACKET, PACKET_IGNORE_OUTGOING, 1)
        packet.setsockopt(SOL_PACKET, PACKET_QDISC_BYPASS, 1)
        stamp_arrivals(packet)
        packet.bind((interface, ETHERCAT))
    except OSError as error:
        packet.close()
        raise LinkError(
            f"cannot open a socket on {interface}: {os.strerror(error.errno or 0)}"
        ) from error
    return packet


def stamp_arrivals(packet: socket.socket) -> None:
    """Enable receive time stamps, from which the packet loop computes the age of frames."""
    packet.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)


def _age_ns(max_age: float | None) -> int:
    if max_age is None:
        return NEVER_NS
    if not 0 <= max_age < 1e9:
        raise ValueError(f"max_age must be 0 to 1e9 s, or None for no limit, not {max_age}")
    return round(max_age * 1e9)


def _raise_priority(interface: str, priority: int) -> None:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        raise LinkError(
            f"the packet loop on {interface} cannot run at SCHED_FIFO {priority}: no permission",
            hint=permission_advice(),
        ) from None


class Server:
    """Server of a segment: sockets, the packet-loop thread and the service thread.

    Args:
        segment: The segment, with clock="monotonic".
        interface: The network interface.
        second: The interface at the other end of a ring.
        priority: SCHED_FIFO priority of the packet loop, 1 to 99; None: unchanged.
        max_age: Maximum time for which a frame may wait for the packet loop [s]. Older frames are
            dropped and counted in `frames.expired`, because a cable does not store frames. None:
            answer all frames.

    Raises:
        LinkError: An interface does not exist, is down or is used twice, or access is not
            permitted.
        ValueError: An option does not fit the segment or is out of range.
    """

    def __init__(
        self,
        segment: Segment,
        interface: str,
        *,
        second: str | None = None,
        priority: int | None = None,
        max_age: float | None = MAX_AGE,
    ) -> None:
        if segment.clock != "monotonic":
            raise ValueError(
                'a served segment must run in real time; use Segment(..., clock="monotonic")'
            )
        if priority is not None and not 1 <= priority <= 99:
            raise ValueError(f"priority must be 1 to 99 (SCHED_FIFO), not {priority}")
        if second is not None and not segment.ring:
            raise ValueError("a second interface requires a ring; use Segment(..., ring=True)")
        self.segment = segment
        self.interface = interface
        self._priority = priority
        self._max_age_ns = _age_ns(max_age)
        self._socket = _open_socket(interface)
        self._second = None if second is None else self._open_second(second)
        self._stop = os.eventfd(0, os.EFD_CLOEXEC)
        self._service = segment.service
        self._thread = threading.Thread(target=self._run, name="virtual-packets", daemon=True)
        self._started = threading.Event()
        self._ended = threading.Event()
        self._process = os.getpid()
        self.failure: LinkError | None = None

    def _open_second(self, interface: str) -> socket.socket:
        try:
            if interface == self.interface:
                raise LinkError(
                    f"{interface} cannot be both ends of a ring; use two different interfaces"
                )
            return _open_socket(interface)
        except LinkError:
            self._socket.close()
            raise

    def start(self) -> None:
        if self._second is not None:
            self.segment.wires.raise_end(1, True)
        self._service.start()
        self._thread.start()
        self._started.wait()
        if self._ended.is_set():
            self.stop()
            self.raise_failure()

    def _run(self) -> None:
        try:
            if self._priority is not None:
                _raise_priority(self.interface, self._priority)
            self._started.set()
            second = -1 if self._second is None else self._second.fileno()
            result = self.segment.core.answer_packets(
                self._socket.fileno(), second, self._stop, self._max_age_ns
            )
            if result < 0:
                hint = "the interface went down" if -result == errno.ENETDOWN else ""
                raise LinkError(
                    f"the packet loop on {self.interface} failed: {os.strerror(-result)}", hint=hint
                )
        except LinkError as failure:
            self.failure = failure
        finally:
            self._ended.set()
            self._started.set()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for the end of the packet loop, at most `timeout` [s]; None: no limit.

        Return True if the packet loop has ended.
        """
        return self._ended.wait(timeout)

    def raise_failure(self) -> None:
        if self.failure is not None:
            raise self.failure
        if self._service.failure is not None:
            raise self._service.failure
        if self.segment.plant is not None:
            self.segment.plant.check()

    def stop(self) -> None:
        """End the packet loop and the service thread, and release the interfaces.

        A forked child closes only its copies of the sockets.
        """
        if self._socket.fileno() < 0:
            return
        if self._process != os.getpid():
            for copy in (self._socket, self._second):
                if copy is not None:
                    copy.close()
            return
        os.eventfd_write(self._stop, 1)
        self._thread.join()
        self._service.stop()
        self._socket.close()
        if self._second is not None:
            self._second.close()
            self.segment.wires.raise_end(1, False)
        os.close(self._stop)

    def __enter__(self) -> Server:
        self.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop()


def die_with_parent() -> None:
    """Request a SIGTERM for this process when its parent process ends."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG) failed")


class Served(NamedTuple):
    """Segment and the interfaces that serve it.

    Attributes:
        segment: The segment, with clock="monotonic".
        interface: The network interface.
        second: The interface at the other end of a ring; None: a line.
    """

    segment: Segment
    interface: str
    second: str | None = None


def serve(
    segment: Segment,
    interface: str,
    *,
    second: str | None = None,
    priority: int | None = None,
    max_age: float | None = MAX_AGE,
    with_parent: bool = False,
    ready: Callable[[], None] | None = None,
    on_fault: Callable[[FaultEvent], None] | None = None,
) -> None:
    """Serve a segment until SIGINT or SIGTERM. Call this in the main thread.

    Args:
        segment: The segment, with clock="monotonic".
        interface: The network interface.
        second: See `Server`.
        priority: See `Server`.
        max_age: See `Server`.
        with_parent: True also ends the server when the parent process ends.
        ready: Function to call once when the server answers frames.
        on_fault: Function to call with each entry of the fault log.

    Raises:
        LinkError: An interface does not exist, is down or is used twice, access is not permitted,
            or the packet loop failed.
        ConfigurationError: The simulation of the plant stopped.
        ValueError: An option does not fit the segment or is out of range.
    """
    serve_all(
        [Served(segment, interface, second)],
        priority=priority,
        max_age=max_age,
        with_parent=with_parent,
        ready=ready,
        on_fault=on_fault,
    )


def serve_all(
    served: Sequence[Served],
    *,
    priority: int | None = None,
    max_age: float | None = MAX_AGE,
    with_parent: bool = False,
    ready: Callable[[], None] | None = None,
    on_fault: Callable[[FaultEvent], None] | None = None,
) -> None:
    """Serve several segments in this process, for example those of one plant. See `serve`.

    Args:
        served: The segments and their interfaces.
        priority: See `Server`.
        max_age: See `Server`.
        with_parent: True also ends the servers when the parent process ends.
        ready: Function to call once when all servers answer frames.
        on_fault: Function to call with each entry of the fault logs.

    Raises:
        LinkError: See `serve`.
        ConfigurationError: The simulation of a plant stopped.
        ValueError: An option does not fit a segment or is out of range.
    """
    if with_parent:
        die_with_parent()
    servers: list[Server] = []
    with _stop_signals() as stop_requested, ExitStack() as stack:
        for segment, interface, second in served:
            server = Server(segment, interface, second=second, priority=priority, max_age=max_age)
            servers.append(stack.enter_context(server))
        if ready is not None:
            ready()
        _watch(servers, stop_requested, on_fault)
    for server in servers:
        server.raise_failure()


@contextmanager
def _stop_signals() -> Iterator[threading.Event]:
    """Yield an event that SIGINT and SIGTERM set."""
    stop_requested = threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        stop_requested.set()

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop_requested
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _watch(
    servers: Sequence[Server],
    stop_requested: threading.Event,
    on_fault: Callable[[FaultEvent], None] | None,
) -> None:
    """Report faults until a stop is requested or a packet loop ends. Raise failures."""
    reported = [0] * len(servers)
    while not stop_requested.wait(0.2) and not any(server.wait(0) for server in servers):
        for n, server in enumerate(servers):
            server.raise_failure()
            news = server.segment.fault_log[reported[n] :]
            reported[n] += len(news)
            if on_fault is not None:
                for event in news:
                    on_fault(event)
