"""Files of the guest's root.

They are this interpreter, the distributions that a benchmark imports, Catenary from this working
copy, the libraries that all of these load, and a few programs. All paths are the same as on the
host, so that the guest runs the same files.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from tools.rtlab import archive
from tools.rtlab.archive import Entry
from tools.rtlab.errors import LabError
from tools.rtlab.kernel import Kernel, read_module

MODULES = ("veth",)
EXTRAS = ("law", "peers", "sim", "traj")
PROGRAMS = ("ip", "sh")  # needed by catenary.realtime.private_network
OPTIONAL_PROGRAMS = ("stress-ng", "cyclictest")
UNUSED = {"test", "tests", "idlelib", "tkinter", "ensurepip", "lib2to3", "site-packages", "pip"}
GUEST = "/init"
COMPILED = "/compiled"  # folder of the C peers in the guest
REQUIREMENT = re.compile(r"([\w.-]+)(?:\[([\w,. -]+)\])?[^;]*(?:;(.*))?")


def everything(repository: Path) -> list[Path]:
    """Return the files of a guest that runs benchmarks.

    Raises:
        LabError: A package is not installed.
    """
    return [
        *interpreter(),
        *(path for each in all_distributions() for path in files_of(each)),
        *package(repository),
        *programs(),
    ]


def entries(kernel: Kernel, files: Sequence[Path], compiled: Iterable[Path] = ()) -> list[Entry]:
    """Yield the entries of a system with files and the libraries that they load.

    Args:
        kernel: Kernel of the guest.
        files: Files with the same paths as on the host.
        compiled: Programs that were compiled for the guest.
    """
    return [
        *links(),
        *system(),
        *modules(kernel),
        *map(archive.copy_of, files),
        *map(archive.copy_of, libraries(files)),
        *(Entry(f"{COMPILED}/{path.name}", 0o100755, data=path.read_bytes()) for path in compiled),
    ]


def system() -> Iterator[Entry]:
    """Yield the entries of a system without programs."""
    for path in ("/proc", "/sys", "/dev", "/dev/shm", "/tmp", "/run", "/root", "/results"):
        yield archive.folder(path)
    yield archive.character_device("/dev/console", 5, 1)
    yield archive.text("/etc/passwd", "root:x:0:0:root:/root:/bin/sh\n")
    yield archive.text("/etc/group", "root:x:0:\n")
    yield archive.text("/etc/hosts", "127.0.0.1 localhost\n")
    guest = Path(__file__).with_name("guest.py").read_text()
    yield archive.text(GUEST, f"#!{sys.executable} -I\n{guest}", mode=0o755)


def modules(kernel: Kernel) -> Iterator[Entry]:
    for number, file in enumerate(kernel.with_dependencies(MODULES)):
        mode = 0o100644
        yield Entry(f"/modules/{number:02d}-{file.stem}", mode, data=read_module(file))


def interpreter() -> Iterator[Path]:
    """Yield the files of the interpreter and its standard library, without tests."""
    yield from Path(sys.executable).parent.glob("python*")  # scripts use several of its names
    yield Path(sys.prefix, "pyvenv.cfg")
    yield Path(sysconfig.get_config_var("BINDIR"), f"python{sysconfig.get_python_version()}")
    yield from under(Path(sysconfig.get_path("stdlib")))


def links() -> Iterator[Entry]:
    """Yield folders that are links on a merged system. They must precede the files in them."""
    for path in ("/lib", "/lib64", "/bin", "/sbin"):
        if Path(path).is_symlink():
            yield archive.folder(str(Path(path).resolve()))
            yield archive.link(path, str(Path(path).readlink()))


def under(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if path.name in UNUSED or path.name.startswith("config-"):
            continue
        if path.is_dir():
            yield from under(path)
        elif path.is_file() and path.suffix != ".a":
            yield path


def all_distributions() -> list[Distribution]:
    """Return the distributions of benchmarks and of the cobot, without plotting."""
    return [*distributions("catenary", EXTRAS), *distributions("mcap")]


def distributions(name: str, extras: Iterable[str] = ()) -> list[Distribution]:
    """Return an installed distribution and its dependencies.

    Raises:
        LabError: A distribution is not installed.
    """
    found: dict[str, Distribution] = {}

    def add(name: str, extras: frozenset[str]) -> None:
        key = re.sub(r"[-_.]+", "-", name).lower()
        if key in found:
            return
        try:
            found[key] = distribution(name)
        except PackageNotFoundError:
            raise LabError(f"{name} is not installed in {sys.prefix}: `make build`") from None
        for needed, its_extras in needed_by(found[key].requires or (), extras):
            add(needed, its_extras)

    add(name, frozenset(extras))
    return list(found.values())


def needed_by(
    requires: Iterable[str], extras: frozenset[str]
) -> Iterator[tuple[str, frozenset[str]]]:
    """Yield the names and extras of requirements that apply here, with `extras`."""
    for line in requires:
        match = REQUIREMENT.match(line)
        if match is None:
            continue
        wanted = re.search(r"extra\s*==\s*['\"]([\w.-]+)['\"]", match[3] or "")
        if (wanted[1] in extras) if wanted else not match[3]:
            its = frozenset(part.strip() for part in (match[2] or "").split(",") if part.strip())
            yield match[1], its


def files_of(one: Distribution) -> Iterator[Path]:
    for file in one.files or ():
        path = Path(str(one.locate_file(file)))
        if path.is_file() and not UNUSED & set(file.parts):
            yield path.parent.resolve() / path.name


def package(repository: Path) -> Iterator[Path]:
    yield from under(repository / "src" / "catenary")
    yield from under(repository / "examples")
    benchmarks = repository / "benchmarks"
    yield from (path for path in under(benchmarks) if benchmarks / "results" not in path.parents)


def programs() -> Iterator[Path]:
    for name in PROGRAMS:
        path = shutil.which(name)
        if path is None:
            raise LabError(f"`{name}` is not installed: `sudo apt-get install iproute2 dash`")
        yield Path(path)
    yield from (Path(path) for name in OPTIONAL_PROGRAMS if (path := shutil.which(name)))


def libraries(files: Iterable[Path]) -> list[Path]:
    """Return the libraries that `ldd` finds for programs and libraries, including the loader."""
    linked = sorted({str(path) for path in files if is_linked(path)})
    done = subprocess.run(["ldd", *linked], capture_output=True, text=True, check=False)
    return loaded(done.stdout)


def is_linked(path: Path) -> bool:
    if ".so" not in path.name and not path.stat().st_mode & 0o100:
        return False
    with path.open("rb") as file:
        return file.read(4) == b"\x7fELF"


def loaded(shown: str) -> list[Path]:
    """Return the paths in the output of `ldd`.

    Its lines are "libm.so.6 => /lib/libm.so.6 (0x...)" or "/lib64/ld.so (0x...)".
    """
    found = re.findall(r"(?:=> |^\s+)(/[^\s:]+) \(0x", shown, re.MULTILINE)
    return [Path(path) for path in sorted(set(found))]
