"""Paths in ESI files: backslashes, case, and the folder that they cannot leave."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.esi.references import resolve


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("root/a/device.xml", "root/Modules/Io.XML", "root/Modules/io.xml", "secret.xml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.parametrize(
    ("target", "found"),
    [
        ("..\\Modules\\Io.XML", "Modules/Io.XML"),
        ("..\\modules\\io.xml", "Modules/io.xml"),
        ("../MODULES/IO.XML", "Modules/Io.XML"),
        (".\\device.xml", "a/device.xml"),
        (" device.xml\n", "a/device.xml"),
        ("../../secret.xml", None),
        ("..\\..\\root\\a\\device.xml", None),
        ("/etc/passwd", None),
        ("C:\\TwinCAT\\device.xml", None),
        ("device.xml\0", None),
        ("", None),
        ("missing/device.xml", None),
        ("../Modules", None),
        ("a/" * 100 + "device.xml", None),
    ],
)
def test_a_path_is_relative_to_its_file(folder: Path, target: str, found: str | None) -> None:
    root = folder / "root"
    expected = root / found if found is not None else None
    place = resolve(target, root / "a" / "device.xml", root)
    assert (place.resolve() if place else None) == expected


def test_a_link_cannot_leave_the_folder(folder: Path) -> None:
    (folder / "root" / "link.xml").symlink_to(folder / "secret.xml")
    assert resolve("link.xml", folder / "root" / "device.xml", folder / "root") is None
