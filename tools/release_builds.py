"""Steps of a release that build or test: tests, linters, documentation, sdist, wheels."""

from __future__ import annotations

import gzip
import hashlib
import os
import re
import shutil
import tarfile
from collections.abc import Iterator
from pathlib import Path

from tools.release_step import Failure, Release

PYTHONS = ("3.11", "3.12", "3.13", "3.14")
PYENV = Path("~/.pyenv/versions").expanduser()
BUILD_SDIST = (
    "import sys; from scikit_build_core.build import build_sdist; print(build_sdist(sys.argv[1]))"
)
SUMS = "SHA256SUMS"


def run_tests(release: Release) -> str:
    """Run all tests, which also run the examples. Return the counts of pytest."""
    output = release.run(["make", "test"])
    return "; ".join(re.findall(r"=+ (.*passed.*) in [^=]* =+", output)) or "passed"


def run_lint(release: Release) -> str:
    """Run the linters."""
    release.run(["make", "lint"])
    return "ruff, mypy, import-linter and the terms of the prose"


def build_docs(release: Release) -> str:
    """Build the documentation site, and pack it into an archive."""
    release.run(["make", "docs"])
    path = release.out / f"catenary-docs-{release.version}.tar.gz"
    count = pack(release.root / "out" / "docs", path, path.name.removesuffix(".tar.gz"))
    return f"{path.name}: {count} files"


def pack(folder: Path, path: Path, name: str) -> int:
    """Write a folder as an archive. The same files give the same bytes.

    Args:
        folder: Folder to pack.
        path: Path of the archive.
        name: Name of the folder in the archive.

    Returns:
        The number of files.
    """
    files = sorted(each for each in folder.rglob("*") if each.is_file())
    if folder / "index.html" not in files:
        raise Failure(f"{folder} has no index.html: the documentation was not built")
    path.parent.mkdir(parents=True, exist_ok=True)
    with (
        open(path, "wb") as raw,
        gzip.GzipFile("", "wb", fileobj=raw, mtime=0) as packed,
        tarfile.open(fileobj=packed, mode="w") as archive,
    ):
        for file in files:
            entry = archive.gettarinfo(file, f"{name}/{file.relative_to(folder)}")
            entry.uid = entry.gid = entry.mtime = 0
            entry.uname = entry.gname = ""
            entry.mode = 0o644
            with open(file, "rb") as content:
                archive.addfile(entry, content)
    return len(files)


def build_sdist(release: Release) -> str:
    """Build the source distribution, and check its version."""
    release.out.mkdir(parents=True, exist_ok=True)
    release.run([release.python, "-c", BUILD_SDIST, str(release.out)])
    path = release.out / f"catenary-{release.version}.tar.gz"
    if not path.exists():
        raise Failure(f"{path.name} was not written")
    with tarfile.open(path) as archive:
        names = archive.getnames()
    for needed in ("pyproject.toml", "CMakeLists.txt", "src/catenary/__init__.py", "LICENSE"):
        if f"catenary-{release.version}/{needed}" not in names:
            raise Failure(f"{path.name} does not contain {needed}")
    return f"{path.name}: {len(names)} files"


def build_wheels(release: Release) -> str:
    """Build the wheels with tools/build_wheels; without it, one wheel for this Python."""
    tool = release.root / "tools" / "build_wheels"
    if tool.exists():
        release.run([str(tool), "--out", str(release.out)], {"PYTHON": release.python})
    else:
        wheel = ["-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--quiet"]
        release.run([release.python, *wheel, "--wheel-dir", str(release.out), "."])
    found = wheels(release)
    if not found:
        raise Failure(f"{release.out} has no wheel of {release.version}")
    note = (
        "" if tool.exists() else "; note: tools/build_wheels is missing, the tag is not manylinux"
    )
    return f"{', '.join(path.name for path in found)}{note}"


def wheels(release: Release) -> list[Path]:
    return sorted(release.out.glob(f"catenary-{release.version}-*.whl"))


def test_pythons(release: Release) -> str:
    """Run the tests with each Python at hand for which there is a wheel.

    Each Python gets an environment of its own with the wheel and the requirements of the tests.
    """
    done = []
    for version, python in sorted(interpreters().items()):
        tag = f"cp{version.replace('.', '')}"
        found = [path for path in wheels(release) if f"-{tag}-{tag}-" in path.name]
        own = [path for path in found if path.stem.endswith(os.uname().machine)]
        if not own:
            continue
        environment = release.out / "environments" / tag
        release.run([python, "-m", "venv", "--clear", str(environment)])
        own_python = str(environment / "bin" / "python")
        release.run([own_python, "-m", "pip", "install", "--quiet", f"{own[0]}[test]"])
        release.run([own_python, "tools/run_tests.py"])
        done.append(version)
    if not done:
        raise Failure("no Python at hand has a wheel")
    missing = [version for version in PYTHONS if version not in done]
    note = f"; note: not at hand: {', '.join(missing)}" if missing else ""
    return f"tests passed with {', '.join(done)}{note}"


def interpreters() -> dict[str, str]:
    """Return the interpreters of this machine that Catenary supports, by version."""
    return {version: path for version in PYTHONS for path in candidates(version)}


def candidates(version: str) -> Iterator[str]:
    """Yield at most one interpreter: that of pyenv, or else that of PATH."""
    own = sorted(PYENV.glob(f"{version}.*/bin/python{version}"))
    path = str(own[-1]) if own else shutil.which(f"python{version}")
    if path is not None:
        yield path


def built_files(release: Release) -> list[Path]:
    return sorted(path for path in release.out.glob("catenary-*") if path.is_file())


def remove_files(release: Release) -> None:
    """Remove the files of an earlier run: they can have another content or version."""
    for path in (*built_files(release), release.out / SUMS):
        path.unlink(missing_ok=True)


def write_sums(release: Release) -> str:
    """Write the SHA-256 sums of all files of the release."""
    files = built_files(release)
    if not files:
        raise Failure(f"{release.out} has no files")
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    (release.out / SUMS).write_text("".join(lines))
    return f"{SUMS}: {len(files)} files"
