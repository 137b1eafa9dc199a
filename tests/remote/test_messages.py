"""The tables of the messages, the service and the client agree."""

from __future__ import annotations

import inspect
from typing import get_type_hints

import msgspec
import pytest

from catenary import errors
from catenary.remote.client import Client
from catenary.remote.connection import decode_response, encode_request, error_of
from catenary.remote.messages import RESULTS, WRITES, Failure
from catenary.remote.methods import METHODS, PEER
from catenary.remote.task import failure_of

OWN = {"call", "close"}


def test_every_method_has_a_result_and_a_client() -> None:
    public = {name for name in vars(Client) if not name.startswith("_")} - OWN
    assert set(METHODS) == set(RESULTS) == public
    assert set(WRITES) < set(METHODS)


@pytest.mark.parametrize("name", RESULTS)
def test_the_client_returns_the_type_of_the_result(name: str) -> None:
    assert get_type_hints(getattr(Client, name))["return"] == RESULTS[name]


@pytest.mark.parametrize("name", RESULTS)
def test_client_and_service_have_the_same_arguments(name: str) -> None:
    ours = list(inspect.signature(getattr(Client, name)).parameters)[1:]
    theirs = list(inspect.signature(METHODS[name]).parameters)[1:]
    assert sorted(ours) == sorted(each for each in theirs if each != PEER)


@pytest.mark.parametrize(
    "error",
    [
        errors.SdoAbort("m", position=1, index=2, subindex=3, code=4, hint="h"),
        errors.StateError("m", position=1, requested=2, actual=3, code=4),
        errors.BusyError("m", retry=0.5),
        errors.LoopError("m", hint="h"),
        ValueError("m"),
        RuntimeError("m"),
    ],
)
def test_an_error_is_raised_as_the_same_class(error: Exception) -> None:
    failure = msgspec.msgpack.decode(msgspec.msgpack.encode(failure_of(error)), type=Failure)
    found = error_of(failure)
    assert type(found) is type(error)
    assert str(found) == str(error)
    assert {k: v for k, v in vars(found).items() if k != "log"} == {
        k: v for k, v in vars(error).items() if k != "log"
    }


@pytest.mark.parametrize("kind", ["SystemExit", "TYPE_CHECKING", "annotations", "no such", ""])
def test_the_service_cannot_choose_another_class(kind: str) -> None:
    assert type(error_of(Failure(kind=kind, message="m"))) is errors.CatenaryError


def test_an_error_with_wrong_details_keeps_its_message() -> None:
    found = error_of(Failure(kind="SdoAbort", message="m", details={"x": 1}))
    assert str(found) == "m"


def test_a_request_that_is_too_long_is_refused() -> None:
    with pytest.raises(ValueError, match="maximum"):
        encode_request(1, "sdo_write", 1.0, {"value": bytes(70_000)})


@pytest.mark.parametrize("message", [b"", b"\xc1", b"\x93\x01\x01", b"\x91" * 5000, bytes(100)])
def test_a_damaged_response_is_a_share_error(message: bytes) -> None:
    with pytest.raises(errors.ShareError):
        decode_response(message)
