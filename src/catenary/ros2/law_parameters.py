"""Parameters of the law that was started last, as parameters `LAW.NAME` of the node."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future

from catenary.errors import CatenaryError
from catenary.remote import Client
from catenary.remote.messages import LawEntry
from catenary.ros2.interface import Backend, Parameter
from catenary.ros2.requests import Requests

INTERVAL = 0.5  # [s] between two requests of the values, which other programs may change


class NodeLawParameters:
    """Owner of the node's parameters.

    Args:
        backend: the node.
        requests: connection to the program of the loop. It is used by nothing else, so that a
            change does not wait for another request.

    Raises:
        NotAvailable: The backend has no parameters.
    """

    def __init__(self, backend: Backend, requests: Requests) -> None:
        self._backend, self._requests = backend, requests
        self._shown: dict[str, Parameter] = {}
        self._places: dict[str, tuple[str, str]] = {}  # law and parameter
        self._asked: Future[list[LawEntry]] | None = None
        self._ask_at = 0.0
        backend.parameters({}, self.change)

    def step(self) -> None:
        """Show the values as last reported, and request a new report when due. Never blocks."""
        if self._asked is not None and self._asked.done():
            # Without an answer, the parameters remain. A change of them is refused with the reason.
            if self._asked.exception() is None:
                self._show(self._asked.result())
            self._asked = None
        now = time.monotonic()
        if self._asked is None and now >= self._ask_at:
            self._ask_at = now + INTERVAL
            self._asked = self._requests.submit(Client.laws)

    def change(self, values: Mapping[str, object]) -> str:
        """Set parameters of one law, all together before one step.

        Args:
            values: requested values by name.

        Returns:
            The reason of a refusal; "" after the change.
        """
        given: dict[str, float] = {}
        for name, value in values.items():
            if not isinstance(value, float):
                return f"{name}: needs a floating-point number, not {value!r}"
            given[self._places[name][1]] = value
        laws = {self._places[name][0] for name in values}
        if len(laws) != 1:
            return f"one request sets parameters of one law, not of {', '.join(sorted(laws))}"
        law = laws.pop()
        try:
            self._requests.call(lambda client: client.set_parameters(law, given))
        except (CatenaryError, ValueError, TypeError, RuntimeError) as error:
            return str(getattr(error, "message", error))
        self._asked, self._ask_at = None, 0.0  # a report from before the change is obsolete
        return ""

    def close(self) -> None:
        """End the connection."""
        self._requests.close()

    def _show(self, laws: Sequence[LawEntry]) -> None:
        found = node_parameters(laws)
        shown = {name: parameter for name, (_, _, parameter) in found.items()}
        self._places = {name: (law, key) for name, (law, key, _) in found.items()}
        if shown != self._shown:
            self._backend.parameters(shown, self.change)
            self._shown = shown


def node_parameters(laws: Sequence[LawEntry]) -> dict[str, tuple[str, str, Parameter]]:
    """Return law, name in the law, and parameter, by name in the node."""
    return {
        f"{law.name}.{name}": (
            law.name,
            name,
            Parameter(
                value=each.value,
                minimum=each.minimum,
                maximum=each.maximum,
                description=f"[{each.unit}]" if each.unit else "",
            ),
        )
        for law in laws
        for name, each in law.parameters.items()
        if isinstance(each.value, float)  # the service of the program sets single numbers only
    }
