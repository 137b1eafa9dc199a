"""The fuzz targets with a limited number of inputs. Every decoder has a target."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator

import pytest

import catenary.wire
from catenary.errors import DecodeError
from tests.fuzz.fuzz_wire import TARGETS, Target, check, fuzz

HOSTILE = (
    b"",
    *(
        bytes((byte,)) * size
        for byte in (0x00, 0x01, 0x80, 0xFF)
        for size in (1, 64, 1514, 0x20000)
    ),
)


def decoders() -> Iterator[str]:
    for module in pkgutil.iter_modules(catenary.wire.__path__):
        namespace = importlib.import_module(f"catenary.wire.{module.name}")
        for name, value in vars(namespace).items():
            if getattr(value, "__module__", None) != namespace.__name__:
                continue
            if inspect.isfunction(value) and name.startswith("decode"):
                yield f"{module.name}.{name}"
            if inspect.isclass(value):
                found = [part for part in ("from_word", "from_byte") if part in vars(value)]
                yield from (f"{module.name}.{name}.{part}" for part in found)


def test_every_decoder_has_a_target():
    assert set(decoders()) <= {target.name for target in TARGETS}


def test_names_of_targets_are_unique():
    assert len({target.name for target in TARGETS}) == len(TARGETS)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_the_corpus_holds_valid_values(target: Target):
    values = 0
    for data in target.corpus:
        check(target, data)
        try:
            target.decode(data)
            values += 1
        except DecodeError:
            continue
    assert values > 0


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_mutated_bytes_give_a_value_or_decode_error(target: Target):
    assert fuzz((target,), seed=1, rounds=400) == 400


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_hostile_bytes_give_a_value_or_decode_error(target: Target):
    for data in HOSTILE:
        check(target, data)


def test_a_decoder_with_a_wrong_error_is_found():
    broken = Target("broken", lambda data: data[3], None, (b"",))
    with pytest.raises(IndexError) as caught:
        fuzz((broken,), seed=1, rounds=100)
    assert "fuzz target broken" in caught.value.__notes__[0]
