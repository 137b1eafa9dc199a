"""Requests of the bridge to the program of the loop, in a thread, because they may take seconds."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from catenary.errors import CatenaryError, ResponseTimeout
from catenary.remote import Client, connect
from catenary.remote.messages import Axis, Device, Done
from catenary.ros2.config import LawParameters
from catenary.ros2.diagnostics import Reports
from catenary.ros2.messages import Float64MultiArray

T = TypeVar("T")
FAILED = "failed requests"


class Requests:
    """Owner of the connection to a program, and of the thread that uses it.

    Args:
        name: name of the share.
        uid: owner of the share (`cat.attach`).
        timeout: deadline of a request [s].
    """

    def __init__(self, name: str, uid: int | None, timeout: float) -> None:
        self._name, self._uid, self._timeout = name, uid, timeout
        self._client: Client | None = None  # used by the thread only
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="catenary ros2 requests")
        self._devices: list[Device] = []
        self._asked: Future[list[Device]] | None = None
        self._setting: dict[str, Future[Done]] = {}
        self.problem = ""  # why the devices are not known; "" without a problem

    def axes(self) -> list[Axis]:
        """Return the axes of the loop with their limits. Raises CatenaryError."""
        return self.call(Client.axes)

    def call(self, function: Callable[[Client], T]) -> T:
        """Run a request and return its result.

        Raises:
            CatenaryError: The request failed, or had no answer before the deadline.
            ValueError: The request is not valid.
        """
        pending = self.submit(function)
        try:
            return pending.result(self._timeout)
        except TimeoutError as error:
            pending.cancel()
            raise ResponseTimeout(
                f"the program of the share {self._name!r} did not answer in {self._timeout:g} s"
            ) from error

    def submit(self, function: Callable[[Client], T]) -> Future[T]:
        """Start a request. Never blocks."""
        return self._worker.submit(self._run, function)

    def devices(self) -> list[Device]:
        """Return the devices as last reported, and request a new report. Never blocks."""
        if self._asked is not None and self._asked.done():
            error = self._asked.exception()
            self.problem = "" if error is None else str(getattr(error, "message", error))
            self._devices = [] if error is not None else self._asked.result()
            self._asked = None
        if self._asked is None:
            self._asked = self.submit(Client.devices)
        return self._devices

    def set_parameters(
        self, config: LawParameters, reports: Reports, message: Float64MultiArray
    ) -> None:
        """Set parameters of the running law. Never blocks.

        A message is refused while the one before it has no answer.

        Args:
            config: law and names of its parameters.
            reports: receives refused messages.
            message: the new values.
        """
        values = list(message.data)
        pending = self._setting.get(config.topic)
        if len(values) != len(config.names) or not all(map(math.isfinite, values)):
            text = f"needs {len(config.names)} finite numbers, not {values}"
            reports.add("refused parameters", f"{config.topic}: {text}")
        elif pending is not None and not pending.done():
            reports.add("refused parameters", f"{config.topic}: the last request is not done")
        else:
            given = dict(zip(config.names, values, strict=True))
            made = self.submit(lambda client: client.set_parameters(config.law, given))
            made.add_done_callback(lambda done: report_failure(done, config.topic, reports))
            self._setting[config.topic] = made

    def close(self) -> None:
        """End the thread, after the deadline of a running request at the latest."""
        self._worker.shutdown(cancel_futures=True)
        if self._client is not None:
            self._client.close()

    def _run(self, function: Callable[[Client], T]) -> T:
        """Run a request in the thread. Connect again after an error."""
        if self._client is None:
            self._client = connect(self._name, uid=self._uid, timeout=self._timeout)
        try:
            return function(self._client)
        except CatenaryError:
            self._client.close()
            self._client = None
            raise


def report_failure(done: Future[Done], topic: str, reports: Reports) -> None:
    """Report the error of a request; a no-op without an error.

    Args:
        done: the request.
        topic: topic of the request.
        reports: receives the error.
    """
    error = None if done.cancelled() else done.exception()
    if error is not None:
        reports.add(FAILED, f"{topic}: {getattr(error, 'message', error)}")
