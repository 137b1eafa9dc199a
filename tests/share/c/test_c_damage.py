"""Files that are not a share, truncated or damaged: an error, and never a crash.

The program runs with AddressSanitizer and UBSan where the compiler has them.
"""

from __future__ import annotations

import json
import os
import random
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary.share.layout import HEADER, MAGIC, VERSION
from tests.share.c.compile import C11, SANITIZERS, build_program, has_sanitizers
from tests.share.c.library import (
    ARGUMENT,
    DAMAGED,
    NOT_FOUND,
    NOT_TRUSTED,
    CError,
    Library,
)
from tests.share.c.library import VERSION as OTHER_VERSION
from tests.share.names import own_name, state_file
from tests.share.test_lease import cell_of

MUTATIONS = 300


@pytest.fixture(scope="module")
def checked_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sanitized")
    options = SANITIZERS if has_sanitizers(folder) else ()
    return build_program(folder, C11, *options)


@pytest.fixture(scope="module")
def whole() -> Iterator[bytes]:
    """The bytes of the share of a loop."""
    with own_name("whole") as name, cell_of(name) as cell:
        cell.cycles(10)
        yield state_file(name).read_bytes()


def opened(program: Path, contents: bytes) -> tuple[int, str]:
    """Return the code and the text after an attempt to open a share with these bytes."""
    [result] = opened_all(program, [contents])
    return result


def opened_all(program: Path, contents: list[bytes]) -> list[tuple[int, str]]:
    with own_name("damaged") as name:
        names = [f"{name}-{k}" for k in range(len(contents))]
        for each, data in zip(names, contents, strict=True):
            state_file(each).write_bytes(data)
        done = subprocess.run([program, "open", *names], capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        lines = [line.partition(" ") for line in done.stdout.splitlines()]
        assert len(lines) == len(contents)
        return [(int(code), text) for code, _, text in lines]


def with_description(whole: bytes, **changes: object) -> bytes:
    """Return a share whose description has other members."""
    _, version, length, size = HEADER.unpack(whole[: HEADER.size])
    described = json.loads(whole[HEADER.size : HEADER.size + length])
    text = json.dumps(described | changes).encode()
    head = HEADER.pack(MAGIC, version, len(text), size)
    return head + text + whole[HEADER.size + len(text) :]


def test_unchanged_copy_is_readable(checked_program: Path, whole: bytes) -> None:
    assert opened(checked_program, whole) == (0, "")
    assert opened(checked_program, with_description(whole, later={"a": [1, -2.5e3, None]})) == (
        0,
        "",
    )


@pytest.mark.parametrize("size", [1, 8, 23, 24, 100, 4096])
def test_truncated_file_is_refused(checked_program: Path, whole: bytes, size: int) -> None:
    code, text = opened(checked_program, whole[:size])
    assert code == DAMAGED
    assert "truncated" in text or "too short" in text


def test_other_files_are_refused(checked_program: Path) -> None:
    noise = random.Random(1).randbytes(5000)
    found = opened_all(checked_program, [b"", b"\0" * 5000, noise])
    assert [code for code, _ in found] == [DAMAGED] * 3
    assert "empty" in found[0][1]
    assert "bad magic number" in found[1][1]


def test_other_version_is_refused(checked_program: Path, whole: bytes) -> None:
    other = whole[:8] + struct.pack("<I", VERSION + 1) + whole[12:]
    code, text = opened(checked_program, other)
    assert code == OTHER_VERSION
    assert f"version {VERSION + 1}, but this program reads version {VERSION}" in text


@pytest.mark.parametrize(
    "changes",
    [
        {"period": 0.0},
        {"period": -1e-3},
        {"period": "1 ms"},
        {"run": "short"},
        {"writer": {"pid": 1}},
        {"axes": [1]},
        {"rows": {"offset": 4096, "count": 3, "size": 64}},
        {"rows": {"offset": 4096, "count": 2**24, "size": 2**24}},
        {"rows": {"offset": 2**62, "count": 64, "size": 64}},
        {"rows": {"offset": 4097, "count": 64, "size": 64}},
        {"rows": {"offset": -64, "count": 64, "size": 64}},
        {"rows": {"offset": 2**64, "count": 64, "size": 64}},
        {"events": {}},
        {"fields": [{"name": "a", "dtype": "<f8", "shape": [2**40], "unit": "", "offset": 0}]},
        {"fields": [{"name": "a", "dtype": "<f8", "shape": [], "unit": "", "offset": 2**40}]},
        {"fields": [{"name": "a", "dtype": "O", "shape": [], "unit": "", "offset": 0}]},
        {"fields": [{"name": "a", "dtype": ">f8", "shape": [], "unit": "", "offset": 0}]},
        {"fields": [{"dtype": "<f8", "shape": [], "unit": "", "offset": 0}]},
        {"fields": {}},
    ],
)
def test_invalid_description_is_refused(
    checked_program: Path, whole: bytes, changes: dict[str, object]
) -> None:
    code, text = opened(checked_program, with_description(whole, **changes))
    assert code == DAMAGED
    assert "the description of the share is invalid" in text


def test_deeply_nested_description_is_refused(checked_program: Path, whole: bytes) -> None:
    text = b'{"x":' + b"[" * 100_000
    head = HEADER.pack(MAGIC, VERSION, len(text), len(whole))
    contents = (head + text).ljust(len(whole), b"\0")
    assert opened(checked_program, contents)[0] == DAMAGED


def test_damaged_descriptions_never_crash(checked_program: Path, whole: bytes) -> None:
    chance = random.Random(14)
    length = HEADER.unpack(whole[: HEADER.size])[2]
    end = HEADER.size + length
    damaged = []
    for _ in range(MUTATIONS):
        head = bytearray(whole[:end])
        for _ in range(chance.randint(1, 4)):
            head[chance.randrange(len(head))] = chance.choice(b'{}[]",:\\u0129-e.\x00\xff')
        damaged.append(bytes(head) + whole[end : end + 100_000])  # mostly truncated
        damaged.append(bytes(head) + whole[end:])
    found = [
        result
        for start in range(0, len(damaged), 20)
        for result in opened_all(checked_program, damaged[start : start + 20])
    ]
    assert {code for code, _ in found} >= {DAMAGED, 0}


@pytest.mark.parametrize("name", ["", "a/b", "../x", ".x", "x" * 65, "ä"])
def test_invalid_names_are_refused(library: Library, name: str) -> None:
    with pytest.raises(CError, match="invalid name") as caught:
        library.attach(name)
    assert caught.value.code == ARGUMENT


@pytest.mark.parametrize("uid", [-2, 2**32])
def test_invalid_user_ids_are_refused(library: Library, name: str, uid: int) -> None:
    with pytest.raises(CError, match="is not a user id") as caught:
        library.attach(name, uid=uid)
    assert caught.value.code == ARGUMENT


def test_missing_share_is_not_found(library: Library, name: str) -> None:
    with pytest.raises(CError, match="there is no share") as caught:
        library.attach(name)
    assert caught.value.code == NOT_FOUND


def test_symbolic_link_is_not_followed(library: Library, name: str, whole: bytes) -> None:
    with own_name("target") as target:
        state_file(target).write_bytes(whole)
        os.symlink(state_file(target), state_file(name))
        with pytest.raises(CError, match="cannot open") as caught:
            library.attach(name)
        assert caught.value.code == DAMAGED


def test_share_of_another_user_is_not_trusted(library: Library, name: str, whole: bytes) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can create a file of another user")
    state_file(name).write_bytes(whole)
    os.chown(state_file(name), 12345, -1)
    with pytest.raises(CError, match=r"belongs to another user \(12345\)") as caught:
        library.attach(name)
    assert caught.value.code == NOT_TRUSTED
