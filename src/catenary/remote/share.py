"""Share that also serves requests: the public `catenary.Share`."""

from __future__ import annotations

from catenary.errors import ShareError
from catenary.loop.network import Network
from catenary.plan.sink import Incident
from catenary.remote.connection import REMOTE
from catenary.remote.listener import Listener
from catenary.remote.methods import Methods
from catenary.remote.program import Program
from catenary.remote.service import Service
from catenary.remote.task import Task
from catenary.share import folder, share
from catenary.share.process import command_of

TEXT_MAX = 200  # characters of the arguments in an event


class Share(share.Share):
    """Owner of a name under which other processes find the cycles of a loop.

        with cat.Share("arm") as share, cat.Loop(arm, period=1e-3, sink=share) as loop:
            for cycle in loop: ...

    Other processes call `cat.attach("arm")` for the cycles, and `cat.connect("arm")` for requests,
    such as reading an object. Neither can delay the loop.

    A share serves one loop at a time. Each loop that opens it creates a new segment, whose cycles
    are numbered from 1. Readers of the previous segment detect its end and must attach again.

    Args:
        name: name of the share.
        history: time span of the cycles that readers can access [s].
        mode: permissions as for chmod. 0o600: this user only. 0o640: the group can read.
            0o660: the group can read, command and send requests. Only this user can ever write to
            the cycles.
        jog: accept jogs from clients, and their requests to enable and reset axes. They can always
            stop and disable axes.
        modes: operating modes that operators can request: names, or description by name.
        presets: presets that operators can request, in the same form.

    Raises:
        ShareError: on entry, if the name belongs to a running process or another user.
        TypeError: `mode` is not a number, or a name or description is not a text.
        ValueError: an argument is out of range.
    """

    _service: Service | None = None

    def serve(self, network: object) -> None:
        """Start the service for requests to the network of a loop. Called by the loop.

        Raises:
            ShareError: The socket belongs to another user.
        """
        if not isinstance(network, Network):
            raise TypeError(f"{network!r} is not a network of a loop")
        where = folder.own_folder()
        methods = Methods(Program(self, network, self.shared_events))
        listener = Listener(where, self.permissions)
        service = Service(listener, methods, self._report_write)
        self._network = network
        try:
            service.start(where / folder.file_name(REMOTE, self.name))
        except BaseException as error:
            service.close()
            if isinstance(error, PermissionError):  # the sticky bit protects files of other users
                raise ShareError(
                    f"the requests of the share {self.name!r} belong to another user",
                    hint="choose another name",
                ) from error
            raise
        self._service = service

    def close(self) -> None:
        """End the service, the segment and all leases. Called by the loop."""
        service, self._service = self._service, None
        if service is not None and not self.is_inherited:
            service.close()
        super().close()

    def _report_write(self, task: Task) -> None:
        """Publish an event that names the client of a completed write."""
        params, peer = task.request.params, task.connection.peer
        program = "".join(c if c.isprintable() else "?" for c in command_of(peer.pid))
        words = ", ".join(f"{name}={value!r}" for name, value in params.items())
        self.report(
            Incident(
                kind="RemoteWrite",
                message=f"{peer} ({program[:TEXT_MAX]}): {task.request.method}({words[:TEXT_MAX]})",
                time=self._network.session.engine.now() * 1e-9,
                position=params.get("position"),
                details={"pid": peer.pid, "uid": peer.uid, "method": task.request.method},
            )
        )
