"""Modules of the kernel's GPIO simulator for the guest.

Debian 12 builds its kernels without it (`# CONFIG_GPIO_SIM is not set` in boot/config-*). Build
`gpio-sim` and `configfs` from linux-source-6.1 with the headers of the guest's kernel, and give the
folder. `irq_sim.c`, which Debian leaves out too, must be part of the first module.
"""

from __future__ import annotations

from pathlib import Path

from tools.rtlab import archive, igh, root
from tools.rtlab.archive import Entry
from tools.rtlab.kernel import Kernel

MODULES = ("configfs", "gpio-sim")  # in the order in which they are loaded
FOLDER = "/gpio"  # of the guest
TABLE = "gpio_table.py"


def provide(folder: Path | None, kernel: Kernel) -> list[Entry]:
    """Return the modules, gpiod and the table for the guest.

    Args:
        folder: folder with the modules.
        kernel: kernel of the guest.

    Raises:
        NotThere: A module is missing or does not fit the kernel.
        LabError: gpiod is not installed.
    """
    if folder is None:
        raise igh.NotThere("the kernel has no gpio-sim, and GPIO=path is not a folder with it")
    modules = list(igh.modules(folder, kernel, MODULES, FOLDER))
    files = [path for each in root.distributions("gpiod") for path in root.files_of(each)]
    files += root.libraries(files)
    program = archive.text(f"{FOLDER}/{TABLE}", Path(__file__).with_name(TABLE).read_text())
    return [*modules, program, *map(archive.copy_of, files)]
