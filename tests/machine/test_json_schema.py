"""The JSON schema for editors, checked with the package jsonschema."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from catenary.machine import schema
from tests.machine.files import SMALL

jsonschema = pytest.importorskip("jsonschema")


def check(text: str) -> None:
    jsonschema.Draft202012Validator(schema.json_schema()).validate(tomllib.loads(text))


def test_the_schema_is_valid() -> None:
    jsonschema.Draft202012Validator.check_schema(schema.json_schema())


def test_the_schema_accepts_a_machine_file() -> None:
    check(SMALL)


def test_the_schema_accepts_the_example(shared_data: Path) -> None:
    check((shared_data.parent / "examples" / "machine.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("period", "perod"),
        ('mode = "csp"', 'mode = "cps"'),
        ("priority = 80", "priority = 180"),
        ('name = "j1"', "name = 1"),
        (", product = 0x20004", ""),
    ],
)
def test_the_schema_rejects_invalid_files(old: str, new: str) -> None:
    assert old in SMALL
    with pytest.raises(jsonschema.ValidationError):
        check(SMALL.replace(old, new, 1))
