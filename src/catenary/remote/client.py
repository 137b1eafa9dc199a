"""Client of the remote service of a share: `catenary.connect` creates it."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from catenary.errors import ResponseTimeout, ShareError
from catenary.remote import messages
from catenary.remote.connection import (
    Answer,
    decode_response,
    encode_request,
    lost,
    open_connection,
    retry_time,
)
from catenary.remote.messages import MESSAGE_SIZE, TIMEOUT

GRACE = 0.5  # [s] after the deadline of a request, for the error of the service


def connect(name: str, *, uid: int | None = None, timeout: float = TIMEOUT) -> Client:
    """Connect to the program that owns the share `name`. Use the result in a `with` block.

    Args:
        name: Name of the share.
        uid: Owner of the share; None: this user or root.
        timeout: Default deadline of a request [s].

    Returns:
        The client of the share's program.

    Raises:
        ShareError: The share does not exist or has no service, its program does not answer, or it
            belongs to another user.
        ValueError: The name is invalid.
    """
    return Client(name, open_connection(name, uid), timeout)


class Client:
    """Requests to the program that owns a share: devices, objects, diagnosis and timing.

        with cat.connect("arm") as arm:
            for device in arm.devices():
                print(device.position, device.name, device.state)
            print(arm.sdo_read(2, 0x6064).text)

    Requests need no lease, and run next to the loop without delaying it. Any thread may use the
    client, which sends one request at a time. Each method raises the error of the request: an error
    of `catenary.errors`, or ValueError, TypeError or RuntimeError for a mistake of the caller. It
    raises ShareError if the program has ended, and ResponseTimeout at the deadline.
    """

    def __init__(self, name: str, connection: socket.socket, timeout: float) -> None:
        self.name = name
        self._connection = connection
        self._timeout = timeout
        self._serial = 0
        self._lock = threading.Lock()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection. A second call has no effect."""
        self._connection.close()

    def call(self, method: str, /, *, timeout: float | None = None, **params: Any) -> Any:
        """Call a method, wait for its result and return it, or raise its error.

        If the service is busy, repeat the request until the deadline.

        Args:
            method: Name of a method of this class, such as "devices".
            timeout: Deadline [s]; None: that of the client.
            **params: Arguments of the method.

        Returns:
            The value that `messages.RESULTS` names for the method.
        """
        limit = self._timeout if timeout is None else timeout
        deadline = time.monotonic() + limit
        while True:
            left = max(deadline - time.monotonic(), 0.0)
            try:
                return self._once(method, left, params)
            except ShareError as error:
                pause = retry_time(error)
                if pause is None or time.monotonic() + pause >= deadline:
                    raise
                time.sleep(pause)

    def _once(self, method: str, timeout: float, params: Mapping[str, Any]) -> Any:
        with self._lock:
            self._serial += 1
            message = encode_request(self._serial, method, timeout, params)
            try:
                self._connection.settimeout(timeout + GRACE)
                with suppress(BrokenPipeError):  # the service may have sent the reason
                    self._connection.send(message)
                return self._answer(timeout).result(method)
            except TimeoutError as error:
                raise ResponseTimeout(
                    f"the program of the share {self.name!r} did not answer {method!r} within "
                    f"{timeout:g} s",
                    hint="check if it is stopped or overloaded; allow more time with timeout=",
                ) from error
            except OSError as error:
                raise lost(self.name) from error

    def _answer(self, timeout: float) -> Answer:
        """Receive the answer to the last request; discard late ones to earlier requests."""
        end = time.monotonic() + timeout + GRACE
        answer = Answer()
        while not answer.complete:
            message = self._connection.recv(MESSAGE_SIZE)
            if not message:
                raise lost(self.name)
            response = decode_response(message)
            if response.serial in (self._serial, 0):  # 0: for the connection, not a request
                answer.add(response)
            elif time.monotonic() > end:
                raise TimeoutError
        return answer

    # Program and segment

    def hello(self) -> messages.Hello:
        """Return the identity of the program, and what it allows."""
        return self.call("hello")  # type: ignore[no-any-return]

    def devices(self) -> list[messages.Device]:
        """Read the states and counters of all devices, by position."""
        return self.call("devices")  # type: ignore[no-any-return]

    def axes(self) -> list[messages.Axis]:
        """Return the axes of the loop, in the order of the share."""
        return self.call("axes")  # type: ignore[no-any-return]

    def set_state(self, position: int, state: str, *, force: bool = False) -> messages.State:
        """Bring a device of the running loop to a state.

        A device that leaves OP no longer takes part in the cycle. If it is required, the loop ends
        with StateError.

        Args:
            position: Position of the device.
            state: "INIT", "PRE-OP", "SAFE-OP" or "OP".
            force: True to also change the state of a required device.
        """
        return self.call("set_state", position=position, state=state, force=force)  # type: ignore[no-any-return]

    def reset_error(self, position: int) -> messages.State:
        """Acknowledge the AL error of a device, which stays in its state."""
        return self.call("reset_error", position=position)  # type: ignore[no-any-return]

    def registers(self, position: int, address: int, size: int) -> bytes:
        """Read registers of a device.

        Args:
            position: Position of the device.
            address: First address.
            size: Number of bytes, at most 1024.
        """
        return self.call("registers", position=position, address=address, size=size)  # type: ignore[no-any-return]

    # Objects

    def objects(
        self, position: int, after: int | None = None, count: int = 200
    ) -> messages.Objects:
        """Read a page of the object dictionary of a device.

        Args:
            position: Position of the device.
            after: Begin with the object after this index; None: with the first one.
            count: Number of entries after which the page ends, at a complete object.
        """
        return self.call("objects", position=position, after=after, count=count)  # type: ignore[no-any-return]

    def sdo_read(
        self, position: int, index: int, subindex: int = 0, *, type: str | None = None
    ) -> messages.SdoValue:
        """Read an object.

        Args:
            position: Position of the device.
            index: Index of the object.
            subindex: Subindex of the object.
            type: Data type, such as "UDINT"; None: as the dictionary or the ESI describes it.
        """
        return self.call("sdo_read", position=position, index=index, subindex=subindex, type=type)  # type: ignore[no-any-return]

    def sdo_write(
        self,
        position: int,
        index: int,
        subindex: int,
        value: messages.Value,
        *,
        type: str | None = None,
    ) -> messages.SdoValue:
        """Write an object, and return the written value.

        While an axis of the device is enabled, mapped objects and objects that control the axis or
        the mapping are refused.

        Args:
            position: Position of the device.
            index: Index of the object.
            subindex: Subindex of the object.
            value: Bytes, a value of the type, or its text.
            type: Data type, such as "UDINT"; None: as the dictionary or the ESI describes it.
        """
        return self.call(  # type: ignore[no-any-return]
            "sdo_write", position=position, index=index, subindex=subindex, value=value, type=type
        )

    # Diagnosis

    def diagnosis(self) -> messages.DiagnosisResult:
        """Read the error counters and states of all devices, and locate faults."""
        return self.call("diagnosis")  # type: ignore[no-any-return]

    def emergencies(self, position: int) -> list[messages.EmergencyEntry]:
        """Return the most recent emergencies of a device, oldest first."""
        return self.call("emergencies", position=position)  # type: ignore[no-any-return]

    def events(self, after: int = 0) -> messages.Events:
        """Return the events after serial number `after`, oldest first, with advice."""
        return self.call("events", after=after)  # type: ignore[no-any-return]

    def clear_counters(self) -> messages.Done:
        """Set the error counters of all devices to zero."""
        return self.call("clear_counters")  # type: ignore[no-any-return]

    def timing(self, *, histograms: bool = False) -> messages.Timing:
        """Return the timing of the loop since it was opened.

        Args:
            histograms: True to add the histogram of each phase.
        """
        return self.call("timing", histograms=histograms)  # type: ignore[no-any-return]

    def clocks(self) -> messages.Clocks:
        """Return the differences of the distributed clocks from the reference clock."""
        return self.call("clocks")  # type: ignore[no-any-return]

    def plan(self) -> messages.Text:
        """Return the plan of the loop as text."""
        return self.call("plan")  # type: ignore[no-any-return]

    # Operating modes and presets

    def modes(self) -> messages.Modes:
        """Return the operating modes and presets of the program, and its present mode."""
        return self.call("modes")  # type: ignore[no-any-return]

    def set_mode(self, mode: str) -> messages.Done:
        """Request an operating mode, and wait until the program has accepted it.

        The program changes its mode afterwards: read it with `modes`, or as `Reader.mode`.

        Raises:
            RequestRefused: The program refused it, or another request waits for an answer. The
                message is the reason.
            ResponseTimeout: The program has not answered within 1 s. The request is withdrawn.
            ShareError: The loop has ended.
            ValueError: The program does not offer this mode.
        """
        return self.call("set_mode", mode=mode)  # type: ignore[no-any-return]

    def run_preset(self, preset: str) -> messages.Done:
        """Request a preset, and wait until the program has accepted it.

        The preset runs afterwards. Raises the same errors as `set_mode`.
        """
        return self.call("run_preset", preset=preset)  # type: ignore[no-any-return]

    # Motion and laws

    def laws(self) -> list[messages.LawEntry]:
        """Return the laws of the loop and their parameters."""
        return self.call("laws")  # type: ignore[no-any-return]

    def set_parameters(self, law: str, values: Mapping[str, float]) -> messages.Done:
        """Set parameters of a running law, all together before one step.

        Args:
            law: Name of the law.
            values: New values by name; other parameters keep their values.
        """
        return self.call("set_parameters", law=law, values=dict(values))  # type: ignore[no-any-return]

    def home(self, axes: Sequence[str]) -> messages.Done:
        """Start the homing of axes by name, as their `Drives` define it.

        The loop must run in the background, and its share must allow motions: `Share(jog=True)`.
        """
        return self.call("home", axes=list(axes))  # type: ignore[no-any-return]

    def move(
        self, axes: Sequence[str], positions: Sequence[float], velocity: float | None = None
    ) -> messages.Done:
        """Start a move of axes to positions.

        The loop must run in the background, and its share must allow motions: `Share(jog=True)`.

        Args:
            axes: Names of the axes.
            positions: Target of each axis [rad or m].
            velocity: Largest velocity [rad/s or m/s]; None: the limit of each axis.
        """
        return self.call("move", axes=list(axes), positions=list(positions), velocity=velocity)  # type: ignore[no-any-return]

    # Virtual segment

    def virtual_cable(self, position: int, port: int, connected: bool) -> messages.Done:
        """Pull or plug a cable of a virtual segment.

        Args:
            position: Position of a device.
            port: Port of the device at which the cable ends.
            connected: True to plug the cable, False to pull it.
        """
        return self.call("virtual_cable", position=position, port=port, connected=connected)  # type: ignore[no-any-return]

    def virtual_push(
        self,
        body: str,
        force: Sequence[float],
        point: Sequence[float] = (0.0, 0.0, 0.0),
        seconds: float = 0.2,
    ) -> messages.Done:
        """Push a body of the simulated mechanism. Another push of the body replaces it.

        Args:
            body: Name of the body in the model.
            force: (3,) in the frame of the world [N].
            point: (3,) point of the body on which the force acts, in its frame [m].
            seconds: Duration [s], at most 10 s.
        """
        return self.call(  # type: ignore[no-any-return]
            "virtual_push", body=body, force=list(force), point=list(point), seconds=seconds
        )

    def virtual_power(self, position: int, on: bool) -> messages.Done:
        """Switch a device of a virtual segment on or off.

        Args:
            position: Position of the device.
            on: True to switch it on.
        """
        return self.call("virtual_power", position=position, on=on)  # type: ignore[no-any-return]
