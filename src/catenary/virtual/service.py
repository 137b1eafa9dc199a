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
from catenary.virtual.plant import Plant
from catenary.virtual.scheduler import FOREVER, Agenda

STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}
SELECTABLE = 1024
IDLE_SECONDS = 0.02  # maximum interval between steps of device models without frames


class Service:
    """Application side of a segment: its agenda, and the dispatch of events to its devices."""

    def __init__(self, core: Core, devices: Sequence[Device], plant: Plant | None = None) -> None:
        self.core = core
        self.plant = plant
        self.agenda = Agenda(core)
        self._devices = devices
        self._at_first_frame: Callable[[], None] | None = None
        for position, device in enumerate(devices):
            device.attach(core, position, self.agenda)
        if plant is not None:
            plant.attach(core, devices)
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
        if self._service.plant is not None:
            self._service.plant.start()

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
        if self._service.plant is not None:
            self._service.plant.stop()
        self._service.core.wake_by(-1)
        os.close(self._event)
