"""`import catenary as cat`: the names, and the modules that they import."""

from __future__ import annotations

import subprocess
import sys

import pytest

import catenary as cat


@pytest.mark.parametrize("name", cat.__all__)
def test_every_public_name_exists(name: str) -> None:
    assert getattr(cat, name) is not None


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'Drivez'; did you mean 'Drives'"):
        _ = cat.Drivez


@pytest.mark.skipif(
    "site-packages" not in cat.__file__, reason="Jedi does not follow an editable installation"
)
def test_editors_complete_the_names() -> None:
    jedi = pytest.importorskip("jedi", reason="pip install jedi")
    code = 'import catenary as cat\ncat.MainDevice("eth0").'
    names = {each.name for each in jedi.Script(code).complete(2, len(code.splitlines()[1]))}
    assert {"scan", "plan", "passive_scan"} <= names


def test_a_target_is_a_name_or_a_segment() -> None:
    for wrong in (0, None, cat.Segment):
        with pytest.raises(TypeError, match='is not a target: pass a name such as "eth0"'):
            cat.MainDevice(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "use",
    [
        "import catenary",
        "import catenary.realtime",
        "import catenary as cat; cat.MainDevice('virtual').__enter__().scan()",
    ],
)
def test_numpy_is_not_imported_before_it_is_needed(use: str) -> None:
    code = f"{use}\nimport sys\nassert 'numpy' not in sys.modules, 'numpy'"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_errors_of_a_loop_are_top_level_names() -> None:
    assert cat.DriveError is cat.errors.DriveError
    assert issubclass(cat.WorkingCounterError, cat.LoopError)
    assert issubclass(cat.LoopError, cat.CatenaryError)
