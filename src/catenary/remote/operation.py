"""Methods about the operating mode and the presets, which the program of the loop decides."""

from __future__ import annotations

import time

from catenary.errors import RequestRefused, ResponseTimeout
from catenary.remote import messages
from catenary.remote.listener import Peer
from catenary.remote.program import WAITING, Program, Work
from catenary.share.choice import Kind
from catenary.share.operator_request import Answer, OperatorRequest
from catenary.share.process import command_of

ANSWER_NS = 1_000_000_000  # time for the answer of the program
COMMAND_MAX = 80  # characters


def modes(program: Program) -> messages.Modes:
    """Return the operating modes and presets of the program, and its present mode."""
    operation = program.share.operation
    return messages.Modes(
        mode=operation.mode, modes=list(operation.modes), presets=list(operation.presets)
    )


def set_mode(program: Program, mode: str, *, peer: Peer) -> Work[messages.Done]:
    """Request an operating mode; see `Client.set_mode`."""
    return _request(program, "mode", mode, peer)


def run_preset(program: Program, preset: str, *, peer: Peer) -> Work[messages.Done]:
    """Request a preset; see `Client.run_preset`."""
    return _request(program, "preset", preset, peer)


def _request(program: Program, kind: Kind, name: str, peer: Peer) -> Work[messages.Done]:
    """Pass a request to the program, and wait for its answer. Withdraw it at the end of its time.

    The request is submitted by the first step of the work, so that the end of the work always
    withdraws it.
    """
    command = "".join(c if c.isprintable() else "?" for c in command_of(peer.pid))
    client = f"{peer} ({command[:COMMAND_MAX]})"
    request = program.share.operation.submit(kind, name, client)
    until = request.time_ns + ANSWER_NS
    try:
        while request.answer is None and time.monotonic_ns() < until:
            yield WAITING
    finally:
        answer = request.withdraw()
    raise_unless_accepted(request, answer)
    return messages.Done()


def raise_unless_accepted(request: OperatorRequest, answer: Answer) -> None:
    """Raise the error of a request that was refused or withdrawn.

    Args:
        request: the request.
        answer: its answer.

    Raises:
        RequestRefused: the program has refused the request.
        ResponseTimeout: the program has not answered in time.
    """
    if answer.withdrawn:
        raise ResponseTimeout(
            f"the program has not answered the request for {request.kind} {request.name!r} within "
            f"{ANSWER_NS / 1e9:g} s; it is withdrawn",
            hint="the body of its loop must iterate share.requests(), and accept or refuse each",
        )
    if not answer.accepted:
        raise RequestRefused(answer.reason)
