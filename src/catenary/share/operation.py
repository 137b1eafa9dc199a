"""Operating modes and presets of a program, and the request that waits for its answer.

The service of the share submits requests in its thread. The body of the loop takes them. Both sides
share a deque with one place, whose operations are atomic in CPython. Nothing here takes a lock.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from mmap import mmap

from catenary.errors import RequestRefused
from catenary.share.choice import Choice, Kind, Names, make_choices
from catenary.share.operator_request import OnAccepted, OperatorRequest

NO_MODE = 0  # in the byte of the segment; n: mode number n, counted from 1


class Operation:
    """Owner of the operating mode of a program, and of its open request.

    Args:
        modes: operating modes, as names or as description by name.
        presets: presets, in the same form.
        on_accepted: called with each request that the program accepts, in its thread.

    Raises:
        TypeError: a name or description is not a text.
        ValueError: a name or description is invalid, two names are equal, or there are too many.
    """

    def __init__(
        self,
        modes: Names = (),
        presets: Names = (),
        on_accepted: OnAccepted | None = None,
    ) -> None:
        self.modes = make_choices("mode", modes)
        self.presets = make_choices("preset", presets)
        self._on_accepted = on_accepted
        self._mode: str | None = None
        self._place: tuple[mmap, int] | None = None
        self._arrived: deque[OperatorRequest] = deque(maxlen=1)
        self._newest: OperatorRequest | None = None

    @property
    def mode(self) -> str | None:
        """Operating mode; None until the program sets it."""
        return self._mode

    def change_mode(self, name: str) -> str | None:
        """Set and publish the operating mode, and return the mode before.

        Raises ValueError if the program has not declared this mode.
        """
        number = _number_of("mode", name, self.modes)
        before, self._mode = self._mode, name
        self._publish(number)
        return before

    def attach(self, memory: mmap, offset: int) -> None:
        """Publish the mode in a byte of a segment from now on.

        Args:
            memory: memory of the segment.
            offset: offset of the byte.
        """
        self._place = memory, offset
        names = [each.name for each in self.modes]
        self._publish(NO_MODE if self._mode is None else names.index(self._mode) + 1)

    def detach(self) -> None:
        """Withdraw the open request, because the loop has ended."""
        self._place = None
        if self._newest is not None:
            self._newest.withdraw()

    def take(self) -> Sequence[OperatorRequest]:
        """Return the request that has arrived since the last call, if any. Never blocks."""
        if not self._arrived:
            return ()
        try:
            request = self._arrived.popleft()
        except IndexError:  # another thread has taken it
            return ()
        return (request,) if request.answer is None else ()

    def submit(self, kind: Kind, name: str, client: str) -> OperatorRequest:
        """Pass a request to the program. Only one thread may call this.

        Args:
            kind: "mode" or "preset".
            name: name of the mode or preset.
            client: process and user of the client.

        Raises:
            RequestRefused: another request is open.
            ValueError: the program has not declared this mode or preset.
        """
        _number_of(kind, name, self.modes if kind == "mode" else self.presets)
        newest = self._newest
        if newest is not None and newest.answer is None:
            raise RequestRefused(
                f"another request is open: {newest.kind} {newest.name!r} of {newest.client}",
                hint="wait for its answer, then repeat the request",
            )
        self._newest = request = OperatorRequest(kind, name, client, self._on_accepted)
        self._arrived.append(request)
        return request

    def _publish(self, number: int) -> None:
        if self._place is not None:
            memory, offset = self._place
            memory[offset] = number


def _number_of(kind: Kind, name: object, choices: Sequence[Choice]) -> int:
    """Return the number of a choice, counted from 1. Raises ValueError if it is unknown."""
    names = [each.name for each in choices]
    if name in names:
        return names.index(str(name)) + 1
    shown = f"{str(name)[:40]!r}"
    if not names:
        raise ValueError(
            f"{kind} {shown}: the program offers no {kind}s; it can declare them: "
            f"cat.Share(..., {kind}s=(...))"
        )
    raise ValueError(f"unknown {kind} {shown}; {kind}s: {', '.join(names)}")
