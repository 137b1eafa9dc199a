"""Thread that steps a plant in real time."""

from __future__ import annotations

import threading
from collections.abc import Callable

from catenary.virtual._plant import CompiledPlant


class PlantThread:
    """Owner of the thread, which runs without the GIL while at least one segment uses the plant."""

    def __init__(self, compiled: CompiledPlant, check: Callable[[], None]) -> None:
        """Initialise without a thread.

        Args:
            compiled: The compiled plant.
            check: Function that raises the reason why the simulation has stopped, if it has.
        """
        self._compiled = compiled
        self._check = check
        self._users = 0  # number of calls of `start` without `stop`
        self._thread: threading.Thread | None = None

    @property
    def runs(self) -> bool:
        return self._thread is not None

    def start(self) -> None:
        """Start the thread at the first call."""
        self._users += 1
        if self._users == 1:
            self._thread = threading.Thread(target=self._run, name="virtual-plant", daemon=True)
            self._thread.start()

    def _run(self) -> None:
        self._compiled.run()
        self._check()  # the thread prints this error and ends; frames are still answered

    def stop(self) -> None:
        """Stop the thread at the last call, and wait for its end."""
        self._users -= 1
        if self._users == 0 and self._thread is not None:
            self._compiled.end()
            self._thread.join()
            self._thread = None
