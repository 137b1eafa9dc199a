"""The program that serves requests: its share, and the network of the share's loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterator
from importlib.metadata import version
from typing import TypeAlias, TypeVar

import numpy as np

from catenary.bus import SubDevice
from catenary.drive.port import REQUESTED_SHIFT
from catenary.drive.state_machine import RequestedState
from catenary.errors import LoopError
from catenary.loop.network import Network
from catenary.loop.session import Session
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.share.events import SharedEvent
from catenary.share.share import Share
from catenary.wire.cia402 import POWERED

T = TypeVar("T")
WAITING = True
# A method yields None where it may be cut, and WAITING until something outside of it has happened.
Work: TypeAlias = Generator[bool | None, None, T]


class Program:
    """Access of the methods to a share and its network."""

    def __init__(
        self,
        share: Share,
        network: Network,
        events: Callable[[int], tuple[Iterator[SharedEvent], int]],
    ) -> None:
        self.share = share
        self.network = network
        self.events = events  # returns the events after a serial number, and the number of lost
        # Both take milliseconds, so they are made before the first cycle
        self.plan_text = str(network.plan)
        self.version = version("catenary")
        # Data types of entries, by identity, index and subindex
        self.types: dict[tuple[object, int, int], int] = {}
        # Indices and notes of the dictionaries that clients have listed, by identity
        self.dictionaries: dict[object, tuple[tuple[int, ...], list[str]]] = {}

    @property
    def session(self) -> Session:
        """Session of the open loop. Raises LoopError if the loop is not open."""
        session = self.network.session
        if not session.is_open:
            raise LoopError(
                "the loop of the share is starting or ending: no device can be reached",
                hint="repeat the request when the loop runs",
            )
        if session.main.carrier is not None:
            raise LoopError(
                "requests to devices are not available with another master",
                hint="use its own tools, such as `ethercat upload` for the IgH master",
            )
        return session

    def device(self, position: int) -> SubDevice:
        """Return the device at a position. Raises ValueError if there is none."""
        subs = self.network.main.subs
        if not 0 <= position < len(subs):
            raise ValueError(
                f"there is no device {position}; the network has the devices 0 to {len(subs) - 1}"
            )
        return subs[position]

    def channel(self, position: int) -> MailboxChannel:
        """Return the mailbox of a device with an object dictionary.

        Raises:
            ValueError: There is no such device, or it has no object dictionary.
            CatenaryError: The last scan could not read the device. This is its error.
        """
        sub = self.device(position)
        if sub.error is not None:
            raise sub.error
        if sub.channel is None or not sub.channel.layout.coe:
            raise ValueError(
                f"{sub.station} has no object dictionary; couplers and simple terminals have none"
            )
        return sub.channel

    def ask(self, procedure: Procedure[T]) -> Work[T]:
        """Run a procedure in the acyclic queue of the loop, and return its result.

        Raises:
            LoopError: The loop is not open, or ends before the answer.
            CatenaryError: The procedure failed.
        """
        pending = self.session.service.runner.submit(procedure)
        try:
            while not pending.done:
                yield WAITING
        finally:
            pending.cancel()
        return pending.result()

    def powered_axes(self, position: int) -> list[str]:
        """Return the names of the axes of a device that have power, or are requested to be enabled.

        The state is that of the newest cycle, even if the program does not iterate its loop.
        """
        views, newest = self.network.session.views, self.share.newest()
        if newest is None:
            states, flags = views.axis_state, views.axis_flags
        else:
            states, flags = newest["state"], newest["axis_flags"]
        powered = np.isin(states, POWERED) | (flags >> REQUESTED_SHIFT == RequestedState.ENABLED)
        axes = self.network.plan.cycle.axes
        return [axes[i].name for i in np.flatnonzero(powered) if axes[i].device == position]


def checked(check: Callable[[], None], procedure: Procedure[T]) -> Procedure[T]:
    """Run a check when a procedure begins, because its turn may come much later."""
    check()
    return (yield from procedure)


def in_thread(function: Callable[[Callable[[], bool]], T]) -> Work[T]:
    """Run a function that may block in a separate thread, and return its result.

    The function receives another one, which returns True when the request has ended.
    """
    results: list[T] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            results.append(function(given_up.is_set))
        except BaseException as error:  # raised again in the thread of the request
            errors.append(error)

    given_up = threading.Event()
    thread = threading.Thread(target=run, name="catenary remote call", daemon=True)
    thread.start()
    try:
        while thread.is_alive():
            yield WAITING
    finally:
        given_up.set()
    if errors:
        raise errors[0]
    return results[0]
