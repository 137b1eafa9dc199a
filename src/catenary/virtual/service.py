"""Service of a segment: it runs the applications of all devices, outside the frame path.

In virtual time, the compiled clock calls the service when an event is pending or an action is due.
In real time, a thread runs it. An event descriptor wakes this thread.
"""

from __future__ import annotations

import os
import select
import signal
import threading
from collections.abc import Callable, Sequence

from catenary.virtual._segment import EVENT_RESET, Core
from catenary.virtual.devices.device import Device
from catenary.virtual.plant import PlantPart, Runner
from catenary.virtual.scheduler import FOREVER, Agenda

STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}
SELECTABLE = 1024
IDLE_SECONDS = 0.02  # maximum interval between steps of device models without frames


class Service:
    """Application side of a segment: its agenda, and the dispatch of events to its devices."""

    def __init__(
        self, core: Core, devices: Sequence[Device], part: PlantPart | None = None
    ) -> None:
        self.core = core
        self.plant = None if part is None else part.plant
        self.agenda = Agenda(core)
        self._devices = devices
        self._at_first_frame: Callable[[], None] | None = None
        self._thread: ServiceThread | None = None
        self._users = 0  # number of calls of `acquire` without `release`
        for position, device in enumerate(devices):
            if part is not None:
                part.prepare(device)
            device.attach(core, position, self.agenda)
        if part is not None:
            part.attach(core, devices)
            part.plant.services.append(self)
        core.use_service(self.run)

    def at_first_frame(self, action: Callable[[], None]) -> None:
        """Set an action that runs once, when the time of the segment starts."""
        self._at_first_frame = action

    def run(self) -> int:
        """Run all pending work. Return the time of the next action [ns]; FOREVER if there is none.

        Stop signals are blocked during the call. Otherwise a KeyboardInterrupt in the MainDevice's
        program could lose a request inside a device.
        """
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        try:
            signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
            with self.agenda.lock:
                self._run_due()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return self.agenda.next_due

    def _run_due(self) -> None:
        while True:
            events = self.core.take_events()
            for position, flags in events:
                self._devices[position].handle(flags)
                if flags & EVENT_RESET:
                    self._devices[position].reset()
            if self._at_first_frame is not None and self.core.epoch >= 0:
                action, self._at_first_frame = self._at_first_frame, None
                action()
            self.agenda.run_due()
            if self.plant is not None and self.core.is_virtual:
                self.plant.check()
            if not events:
                return

    # -- real time -----------------------------------------------------------------------------

    def start(self) -> None:
        """Run the service in a thread, together with its plant.

        The segments of a plant run together, because its devices continue without a link. Each call
        needs a call of `stop`.
        """
        for service in self._together():
            service.acquire()
        if self.plant is not None:
            self.plant.start()

    def stop(self) -> None:
        """End the thread, unless another segment of the plant needs it.

        The plant ends first, because its thread wakes the services.
        """
        if self.plant is not None:
            self.plant.stop()
        for service in self._together():
            service.release()

    def _together(self) -> Sequence[Runner]:
        return [self] if self.plant is None else self.plant.services

    def acquire(self) -> None:
        """Start the thread of this service at the first call."""
        self._users += 1
        if self._users == 1:
            self._thread = ServiceThread(self)
            self._thread.start()

    def release(self) -> None:
        """End the thread of this service at the last call."""
        self._users -= 1
        if self._users == 0 and self._thread is not None:
            self._thread.stop()

    @property
    def failure(self) -> BaseException | None:
        """Exception that ended the last thread; None if there is none."""
        return None if self._thread is None else self._thread.failure


class ServiceThread:
    """Thread that runs a service in real time."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self.failure: BaseException | None = None  # the exception that ended the thread
        self._event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="virtual-service", daemon=True)

    def start(self) -> None:
        self._service.core.wake_by(self._event)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._serve()
        except BaseException as failure:
            self.failure = failure
            raise

    def _serve(self) -> None:
        core = self._service.core
        while not self._stopping:
            core.advance()
            due = self._service.run()
            wait = IDLE_SECONDS if due == FOREVER else min((due - core.now) / 1e9, IDLE_SECONDS)
            if wait > 0 and self._woken(wait):
                self._drain()

    def _woken(self, wait: float) -> bool:
        """Return True if an event arrived within `wait` [s].

        Prefer select(), because poll() rounds the timeout up to milliseconds and a mailbox answers
        within 0.3 ms. select() does not accept descriptors above 1023.
        """
        if self._event < SELECTABLE:
            return bool(select.select([self._event], [], [], wait)[0])
        poll = select.poll()
        poll.register(self._event, select.POLLIN)
        return bool(poll.poll(wait * 1e3))

    def _drain(self) -> None:
        try:
            os.eventfd_read(self._event)
        except BlockingIOError:
            return

    def stop(self) -> None:
        self._stopping = True
        os.eventfd_write(self._event, 1)
        self._thread.join()
        self._service.core.wake_by(-1)
        os.close(self._event)
