"""Fixture that boots a guest, if this machine can."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import lacking
from tools.rtlab import __main__ as lab
from tools.rtlab import archive, kernel, machine, root
from tools.rtlab.errors import LabError


@dataclass(frozen=True, slots=True)
class Lab:
    """Boot a guest with this interpreter and without Catenary, which takes less time."""

    kernel: kernel.Kernel
    folder: Path

    def run(self, script: str, seconds: float) -> tuple[list[str], dict[str, Any]]:
        """Run `script` in a guest. Return the lines that it prints and the result in its file."""
        image = self.folder / "root.cpio"
        copy = archive.folder("/tmp/copy")  # the folder of CI's working copy
        files = root.entries(self.kernel, [*root.interpreter(), *root.programs()])
        with image.open("wb") as file:
            archive.write([*files, copy], file)
        python = str(next(iter(root.interpreter())))
        job = {"folder": copy.path, "name": "test", "arguments": [python, "-c", script, "FILE"]}
        with machine.started(self.kernel, image, job, self.folder, seconds) as guest:
            return list(guest.lines()), guest.answer()


@pytest.fixture
def rtlab(pytestconfig: pytest.Config, tmp_path: Path) -> Lab:
    """Laboratory with the kernel that `make rtlab` downloaded. Tests download nothing."""
    try:
        machine.program()
    except LabError as error:
        lacking(pytestconfig, "rtlab", str(error))
    kept = sorted(lab.cache().glob("linux-image-*/unpacked"))
    if not kept:
        lacking(pytestconfig, "rtlab", f"no kernel in {lab.cache()}: `make rtlab TABLE=quick`")
    return Lab(kernel.found_in(kept[-1].parent), tmp_path)
