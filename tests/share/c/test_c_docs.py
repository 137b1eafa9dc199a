"""The C programs of docs/how_to/c_programs.md, built by its commands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.share.c.compile import C11, HERE, INCLUDE, build
from tests.share.c.library import ErrorText, Library
from tests.share.processes import Program, comes_true
from tests.share.test_lease import cell_of

PAGE = (HERE.parents[2] / "docs" / "how_to" / "c_programs.md").read_text()
BLOCKS = {
    text.split(":")[0].removeprefix("/* "): text
    for text in re.findall(r"```c\n(.*?)```", PAGE, re.DOTALL)
}


LEASE = ("&axis, 1, 0.5,", "&axis, 1, 600.0,")  # the test machine can pause for longer than 0.5 s


def program_of(folder: Path, name: str) -> Path:
    source = folder / name
    source.write_text(BLOCKS[name].replace(*LEASE))
    return build(folder / source.stem, C11, source, INCLUDE / "catenary_share.c")


def test_replaced_time_of_the_lease_is_on_the_page() -> None:
    assert LEASE[0] in BLOCKS["move_arm.c"]


def test_read_arm_prints_every_position_until_the_end(name: str, tmp_path: Path) -> None:
    with cell_of(name) as cell:
        program = Program.of([str(program_of(tmp_path, "read_arm.c")), name])
        first = program.line()
        cell.cycles(10)
        cell.loop.close()
        last = cell.reader.number
    number = int(first.split()[0])
    while number < last:
        number, position = program.line().split()
        number = int(number)
        assert float(position) == pytest.approx(0.0, abs=1e-4)
    assert number == last
    assert program.process.wait(60.0) == 0
    program.close()


def test_move_arm_moves_the_first_axis(name: str, tmp_path: Path) -> None:
    with cell_of(name) as cell:
        program = Program.of([str(program_of(tmp_path, "move_arm.c")), name])
        start = cell.arm.target.position[0]
        assert comes_true(lambda: bool(cell.cycles(20)))
        assert program.process.wait(60.0) == 0
        program.close()
        assert cell.arm.target.position[0] - start == pytest.approx(0.01, abs=2e-5)


def test_missing_share_is_reported(name: str, tmp_path: Path) -> None:
    for each in BLOCKS:
        program = Program.of([str(program_of(tmp_path, each)), name])
        assert program.process.wait(60.0) == 1
        program.close()


def test_declarations_for_csharp_name_functions_and_sizes_of_the_library(library: Library) -> None:
    functions = re.findall(r'EntryPoint = "catenary_(\w+)"', PAGE)
    assert len(functions) == 10
    for function in functions:
        assert callable(getattr(library, function))
    assert f"SizeConst = {ErrorText.text.size}" in PAGE
