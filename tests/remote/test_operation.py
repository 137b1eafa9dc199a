"""Requests for operating modes and presets, which the body of a loop answers."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import catenary as cat
from catenary.errors import RequestRefused, ResponseTimeout, ShareError
from catenary.remote import Client, connect, connect_async
from catenary.share import OperatorRequest
from tests.remote.programs import OPTIONS, small_segment
from tests.share.names import own_name
from tests.share.processes import comes_true

MODES = {"damping": "hold softly", "stand": "", "balance": "react to pushes"}
PRESETS = ("home", "wave")
KINDS = ("RequestAccepted", "ModeChanged")
Answer = Callable[[cat.Share, OperatorRequest], object]


def obey(share: cat.Share, request: OperatorRequest) -> None:
    if request.accept() and request.kind == "mode":
        share.mode = request.name


def refuse(_: cat.Share, request: OperatorRequest) -> None:
    request.refuse("the robot has fallen: stand it up first")


def ignore(_: cat.Share, request: OperatorRequest) -> None:
    """A program that never answers."""


@contextmanager
def serving(answer: Answer, **options: Any) -> Iterator[tuple[str, cat.Share]]:
    """Open a loop with modes whose body calls `answer` for each request."""
    ended = threading.Event()
    with (
        own_name("operation") as name,
        cat.MainDevice(small_segment()) as main,
        cat.Share(name, modes=MODES, presets=PRESETS, **options) as share,
    ):
        arm = cat.Drives(main.scan().drives, **OPTIONS)
        with cat.Loop(arm, period=1e-3, sink=share) as loop:

            def iterate() -> None:
                while not ended.is_set():
                    next(loop)
                    for request in share.requests():
                        answer(share, request)

            thread = threading.Thread(target=iterate)
            thread.start()
            try:
                yield name, share
            finally:
                ended.set()
                thread.join()


@contextmanager
def client_of(answer: Answer) -> Iterator[tuple[Client, cat.Share]]:
    with serving(answer) as (name, share), connect(name) as client:
        yield client, share


def test_a_client_lists_modes_and_presets() -> None:
    with client_of(obey) as (client, _):
        found = client.modes()
        assert found.mode is None
        assert {each.name: each.description for each in found.modes} == MODES
        assert [each.name for each in found.presets] == list(PRESETS)


def test_an_accepted_mode_becomes_the_mode_of_the_program() -> None:
    with client_of(obey) as (client, share):
        client.set_mode("balance")
        assert comes_true(lambda: client.modes().mode == "balance")
        assert share.mode == "balance"


def test_an_accepted_request_is_an_event_that_names_the_client() -> None:
    with client_of(obey) as (client, _):
        client.set_mode("stand")
        accepted, changed = [each for each in client.events().events if each.kind in KINDS]
        assert (accepted.kind, changed.kind) == KINDS
        assert f"process {os.getpid()}" in accepted.message
        assert "requested mode 'stand': accepted" in accepted.message
        assert accepted.details["name"] == "stand"


def test_a_request_is_an_event_although_its_client_has_left() -> None:
    kept: list[OperatorRequest] = []
    with serving(lambda _, request: kept.append(request)) as (name, _):
        leaving = connect(name)
        thread = threading.Thread(target=lambda: leaving.set_mode("stand"))
        thread.start()
        assert comes_true(lambda: bool(kept))
        assert kept[0].accept()
        assert not kept[0].accept()
        thread.join()
        leaving.close()
        with connect(name) as client:
            found = [each.kind for each in client.events().events]
            assert found.count("RequestAccepted") == 1


def test_the_program_knows_the_client() -> None:
    taken: list[OperatorRequest] = []

    def accept(_: cat.Share, request: OperatorRequest) -> None:
        taken.append(request)
        request.accept()

    with client_of(accept) as (client, _):
        client.run_preset("home")
    assert taken[0].client.startswith(f"process {os.getpid()} of user {os.geteuid()} (")


def test_a_refusal_raises_the_reason_of_the_program() -> None:
    with client_of(refuse) as (client, share):
        with pytest.raises(RequestRefused, match="the robot has fallen: stand it up first"):
            client.set_mode("balance")
        assert share.mode is None
        assert not [each for each in client.events().events if each.kind in KINDS]


def test_a_program_that_never_answers_is_reported_and_others_get_their_turn() -> None:
    with client_of(ignore) as (client, _):
        for _ in range(2):
            with pytest.raises(ResponseTimeout, match="has not answered the request for mode"):
                client.set_mode("stand")


def test_a_late_answer_changes_nothing() -> None:
    kept: list[OperatorRequest] = []
    with client_of(lambda _, request: kept.append(request)) as (client, _):
        with pytest.raises(ResponseTimeout):
            client.set_mode("stand")
        assert not kept[0].accept()


def test_a_newer_request_is_refused_while_one_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.remote.operation.ANSWER_NS", 20_000_000_000)  # a busy machine
    kept: list[OperatorRequest] = []
    with (
        serving(lambda _, request: kept.append(request)) as (name, _),
        connect(name) as client,
        connect(name) as other,
    ):
        first = threading.Thread(target=lambda: other.set_mode("stand"))
        first.start()
        assert comes_true(lambda: bool(kept))
        with pytest.raises(RequestRefused, match="another request is open: mode 'stand'"):
            client.run_preset("wave")
        kept[0].accept()
        first.join()


def test_a_client_that_leaves_withdraws_its_request() -> None:
    kept: list[OperatorRequest] = []
    with serving(lambda _, request: kept.append(request)) as (name, _):
        leaving = connect(name)
        with pytest.raises(ResponseTimeout):
            leaving.call("set_mode", mode="stand", timeout=0.0)
        leaving.close()
        with connect(name) as client:
            thread = threading.Thread(target=lambda: client.run_preset("wave"))
            thread.start()
            assert comes_true(lambda: bool(kept) and kept[-1].kind == "preset")
            kept[-1].accept()
            thread.join()


@pytest.mark.parametrize("name", ["fly", "", "stand\n", "\x1b[2J", "x" * 10_000])
def test_an_unknown_mode_is_refused(name: str) -> None:
    with client_of(obey) as (client, _), pytest.raises(ValueError, match="modes: damping, stand"):
        client.set_mode(name)


def test_a_mode_must_be_a_text_and_clients_cannot_choose_their_name() -> None:
    with client_of(obey) as (client, _):
        with pytest.raises(ValueError, match="set_mode"):
            client.set_mode(7)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="peer"):
            client.call("set_mode", mode="stand", peer=[1, 0, 0])


def test_there_is_no_service_without_a_loop() -> None:
    with (
        own_name("operation") as name,
        cat.Share(name, modes=("stand",)),
        pytest.raises(ShareError, match="no program serves requests"),
    ):
        connect(name)


def test_the_end_of_the_loop_ends_an_open_request() -> None:
    errors: list[BaseException] = []
    kept: list[OperatorRequest] = []

    def request(client: Client) -> None:
        try:
            client.set_mode("stand")
        except ShareError as error:
            errors.append(error)

    with serving(lambda _, request: kept.append(request)) as (name, _):
        client = connect(name)
        thread = threading.Thread(target=request, args=(client,))
        thread.start()
        assert comes_true(lambda: bool(kept))
    thread.join()
    client.close()
    assert "ended" in str(errors[0])
    assert not kept[0].accept()


def test_hundreds_of_requests_leave_the_program_in_control() -> None:
    taken = 0

    def count(share: cat.Share, request: OperatorRequest) -> None:
        nonlocal taken
        taken += 1
        obey(share, request)

    with serving(count) as (name, share), connect(name) as client:
        refused = 0
        for number in range(300):  # the service accepts at most 200 in a second
            try:
                client.call("set_mode", timeout=0.0, mode=list(MODES)[number % 3])
            except (ShareError, ResponseTimeout):
                refused += 1
        assert refused > 0
        assert comes_true(lambda: not client.run_preset("home").note)
        assert share.mode in (None, *MODES)
        assert taken <= 301


def test_an_asynchronous_client_requests_a_mode() -> None:
    async def scenario(name: str) -> str | None:
        async with await connect_async(name) as client:
            await client.call("set_mode", mode="balance")
            await client.call("run_preset", preset="wave")
            found = await client.call("modes")
            return found.mode  # type: ignore[no-any-return]

    with serving(obey) as (name, _):
        assert asyncio.run(scenario(name)) == "balance"
