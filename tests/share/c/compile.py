"""Compile C and C++ programs on catenary_share.h, with every warning as an error."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from catenary.share import include_folder

HERE = Path(__file__).resolve().parent
INCLUDE = Path(include_folder())
WARNINGS = ("-Wall", "-Wextra", "-Werror", f"-I{INCLUDE}")
C11 = ("cc", "-std=c11")
CPP17 = ("c++", "-std=c++17", "-x", "c++")
SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def build(output: Path, language: tuple[str, ...], *arguments: str | Path) -> Path:
    """Compile a program or a library, and return its path."""
    if shutil.which(language[0]) is None:
        pytest.skip(f"no compiler {language[0]}")
    command = [*language, *WARNINGS, *map(str, arguments), "-o", str(output)]
    subprocess.run(command, check=True)
    return output


def build_program(folder: Path, language: tuple[str, ...], *options: str) -> Path:
    """Compile client.c with the implementation, as the documentation says."""
    sources = HERE / "client.c", INCLUDE / "catenary_share.c"
    return build(folder / "client", language, *options, *sources)


def has_sanitizers(folder: Path) -> bool:
    """Return True if the compiler has AddressSanitizer and UBSan, and their programs run."""
    source = folder / "empty.c"
    source.write_text("int main(void) { return 0; }\n")
    program = folder / "empty"
    built = subprocess.run(
        [C11[0], *SANITIZERS, str(source), "-o", str(program)], capture_output=True
    )
    return built.returncode == 0 and subprocess.run([program]).returncode == 0
