"""Run a program of this folder as a user would, with a virtual segment in place of `eth0`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

import pytest

from catenary.virtual import Segment

HERE = Path(__file__).resolve().parent
Names: TypeAlias = Mapping[str, object]
RunProgram: TypeAlias = Callable[[str, Segment | str], Names]


@pytest.fixture
def run_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunProgram:
    """Return a function that runs `<name>.py` in an empty folder and returns its global names.

    Its `"eth0"` becomes the segment given: a `Segment`, or a target such as "virtual".
    """
    monkeypatch.chdir(tmp_path)

    def run(name: str, segment: Segment | str) -> Names:
        path = HERE / f"{name}.py"
        text = path.read_text().replace('"eth0"', "the_segment")
        names: dict[str, object] = {"the_segment": segment, "__name__": "__main__"}
        exec(compile(text, str(path), "exec"), names)
        return names

    return run
