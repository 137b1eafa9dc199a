"""Debian's PREEMPT_RT kernel, downloaded with apt and unpacked, but not installed."""

from __future__ import annotations

import lzma
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tools.rtlab.errors import LabError

PACKAGE = "linux-image-rt-amd64"
DOWNLOAD_SECONDS = 600.0


@dataclass(frozen=True, slots=True)
class Kernel:
    image: Path
    modules: Path  # .../lib/modules/RELEASE
    package: str  # name and version

    @property
    def release(self) -> str:
        return self.modules.name

    def with_dependencies(self, names: tuple[str, ...]) -> list[Path]:
        """Return the files of modules, each after its dependencies.

        Raises:
            LabError: A module does not exist.
        """
        found: dict[str, Path] = {}

        def add(name: str) -> None:
            if name in found:
                return
            files = sorted(self.modules.rglob(f"{name}.ko*")) or sorted(
                self.modules.rglob(f"{name.replace('_', '-')}.ko*")
            )
            if not files:
                raise LabError(f"{self.package} has no module {name}")
            for other in depends(read_module(files[0])):
                add(other)
            found[name] = files[0]

        for name in names:
            add(name)
        return list(found.values())


def read_module(file: Path) -> bytes:
    """Return the content of a module file, which is compressed after Debian 12."""
    content = file.read_bytes()
    return lzma.decompress(content) if file.suffix == ".xz" else content


def depends(module: bytes) -> list[str]:
    """Return the dependencies of a module, from its `.modinfo`."""
    found = re.search(rb"\0depends=([^\0]*)\0", module)
    return [name for name in found[1].decode().split(",") if name] if found else []


def provide(cache: Path) -> Kernel:
    """Return the newest kernel of apt, from `cache` if it is there.

    Without apt or a network, return a kernel from `cache`.

    Raises:
        LabError: There is no kernel.
    """
    kept = sorted(cache.glob("linux-image-*/unpacked"), key=by_version)
    try:
        name = wanted()
        if not (cache / name / "unpacked").exists():
            download(name, cache)
        return found_in(cache / name)
    except LabError:
        if not kept:
            raise
        return found_in(kept[-1].parent)


def by_version(mark: Path) -> list[int]:
    """Return a sort key: 6.1.0-56 comes after 6.1.0-9."""
    return [int(number) for number in re.findall(r"\d+", mark.parent.name)]


def found_in(folder: Path) -> Kernel:
    images = sorted(folder.glob("boot/vmlinuz-*"))
    modules = [path for top in ("lib", "usr/lib") for path in folder.glob(f"{top}/modules/*")]
    if not images or not modules:
        raise LabError(f"{folder} contains no kernel: delete it to download the kernel again")
    return Kernel(images[0], modules[0], folder.name)


def download(name: str, cache: Path) -> None:
    """Download and unpack a package into the cache.

    Raises:
        LabError: The network is not available, or the disk is full.
    """
    package = name.partition("_")[0]
    with tempfile.TemporaryDirectory(prefix="download-", dir=cache) as scratch:
        folder = Path(scratch)
        run_apt(["apt-get", "download", package], folder)
        files = list(folder.glob("*.deb"))
        if not files:
            raise LabError(f"`apt-get download {package}` produced no file")
        target = folder / name
        run(["dpkg-deb", "-x", str(files[0]), str(target)], folder)
        drop_what_is_not_used(target)
        (target / "unpacked").touch()
        target.rename(cache / name)


def wanted() -> str:
    """Return PACKAGE_VERSION of the newest kernel, on which the meta-package depends."""
    if shutil.which("apt-cache") is None or shutil.which("dpkg-deb") is None:
        raise LabError("the lab's kernel is a Debian package, but apt is not installed here")
    package = first_dependency(run(["apt-cache", "depends", PACKAGE], Path.cwd()))
    return f"{package}_{candidate(run(['apt-cache', 'policy', package], Path.cwd()))}"


def first_dependency(shown: str) -> str:
    """Return the first dependency in the output of `apt-cache depends`."""
    for line in shown.splitlines():
        name = line.strip().removeprefix("Depends: ")
        if name.startswith("linux-image-") and name != PACKAGE:
            return name
    raise LabError(f"apt knows no {PACKAGE}: `sudo apt-get update`, on Debian 12 or later")


def candidate(shown: str) -> str:
    """Return the version in the output of `apt-cache policy`."""
    found = re.search(r"Candidate: (\S+)", shown)
    if found is None or found[1] == "(none)":
        raise LabError(f"apt knows {PACKAGE}, but not its version: `sudo apt-get update`")
    return found[1]


def run_apt(command: list[str], folder: Path) -> None:
    try:
        run(command, folder)
    except LabError as error:
        raise LabError(f"{error}; if the package lists are old: `sudo apt-get update`") from None


def run(command: list[str], folder: Path) -> str:
    """Run a command, and return its output.

    Raises:
        LabError: The command failed. The message has the line with the cause.
    """
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=DOWNLOAD_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise LabError(f"`{' '.join(command)}` took longer than {DOWNLOAD_SECONDS:.0f} s") from None
    except OSError as error:
        raise LabError(f"`{' '.join(command)}`: {error}") from None
    if done.returncode != 0:
        raise LabError(f"`{' '.join(command)}` failed: {complaint(done.stderr)}")
    return done.stdout


def complaint(errors: str) -> str:
    """Return the line with the cause. In apt and dpkg it begins with E: or the program's name."""
    lines = [line.strip() for line in errors.splitlines() if not line.startswith("W:")]
    return next((line for line in lines if line), "it said nothing")


def drop_what_is_not_used(folder: Path) -> None:
    """Delete everything except the kernel and network modules. The package has 400 MB."""
    for path in list(unused(folder)):
        shutil.rmtree(path)


def unused(folder: Path) -> Iterator[Path]:
    for kernel in folder.glob("**/lib/modules/*/kernel"):
        yield from (path for path in kernel.iterdir() if path.name not in ("drivers", "net", "lib"))
        yield from (path for path in (kernel / "drivers").iterdir() if path.name != "net")
