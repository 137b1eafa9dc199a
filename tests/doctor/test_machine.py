"""Machine: properties read from files below a root folder."""

from __future__ import annotations

import gzip

import pytest

from catenary.doctor.machine import as_list, cpu_list
from tests.doctor.machines import LAPTOP, make


@pytest.mark.parametrize(
    ("text", "cpus"),
    [
        ("0-3,8", {0, 1, 2, 3, 8}),
        ("5", {5}),
        ("", set()),
        (None, set()),
        ("(null)", set()),  # nohz_full of a kernel that was started without this option
        ("0-1,4-5\n", {0, 1, 4, 5}),
    ],
)
def test_lists_of_cpus(text, cpus):
    assert cpu_list(text) == cpus
    assert cpu_list(as_list(cpus)) == cpus


def test_lists_of_cpus_are_as_short_as_the_kernels():
    assert as_list({8, 0, 2, 1, 10}) == "0-2,8,10"


def test_the_reason_why_a_file_has_no_text(tmp_path):
    machine = make(tmp_path, {"/sys/here": "7"})
    (tmp_path / "sys/folder").mkdir()
    assert machine.number("/sys/here") == 7
    assert machine.number("/sys/gone") is None
    assert machine.lack("/sys/gone") == "this kernel has no /sys/gone"
    assert machine.lack("/sys/folder") == "/sys/folder: Is a directory"


def test_a_file_without_read_permission(tmp_path, monkeypatch):
    machine = make(tmp_path, {"/sys/secret": "7"})

    def refuse(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("pathlib.Path.read_bytes", refuse)  # root may read everything
    assert machine.lack("/sys/secret") == "this user may not read /sys/secret"


def test_a_compressed_kernel_configuration(tmp_path):
    machine = make(tmp_path, {"/proc/sys/kernel/osrelease": "6.1.0"})
    (tmp_path / "proc/config.gz").write_bytes(gzip.compress(b"CONFIG_HZ=250\n# CONFIG_X is not\n"))
    assert machine.configuration == {"CONFIG_HZ": "250"}


def test_a_damaged_configuration_is_empty(tmp_path):
    machine = make(tmp_path, {"/proc/sys/kernel/osrelease": "6.1.0", "/proc/config.gz": "rubbish"})
    assert machine.configuration == {}


def test_the_loops_cpu(tmp_path):
    files = {
        f"{'/sys/devices/system/cpu'}/online": "0-3",
        "/proc/self/status": LAPTOP["/proc/self/status"],
    }
    assert make(tmp_path, files).loop_cpu == 3
    assert make(tmp_path, files, wanted_cpu=1).loop_cpu == 1
    files = {**files, "/sys/devices/system/cpu/isolated": "1-2"}
    machine = make(tmp_path, files)
    assert machine.loop_cpu == 2
    assert machine.other_cpus == {0, 3}


@pytest.mark.parametrize(
    ("files", "kind"),
    [
        ({"/run/systemd/container": "systemd-nspawn"}, "systemd-nspawn"),
        ({"/run/.containerenv": ""}, "podman"),
        ({"/proc/1/cgroup": "0::/kubepods/besteffort/pod1"}, "kubepods"),
        ({"/proc/1/cgroup": "0::/init.scope"}, ""),
    ],
)
def test_kinds_of_containers(tmp_path, files, kind):
    assert make(tmp_path, files).container == kind


@pytest.mark.parametrize(
    ("files", "kind"),
    [
        ({"/sys/hypervisor/type": "xen"}, "xen"),
        ({"/proc/device-tree/hypervisor/": ""}, "unknown hypervisor, device tree"),
        ({"/proc/cpuinfo": "flags\t: fpu hypervisor"}, "unknown hypervisor, /proc/cpuinfo"),
        ({"/proc/cpuinfo": "model name : hypervisor lover"}, ""),
    ],
)
def test_kinds_of_hypervisors(tmp_path, files, kind):
    assert make(tmp_path, files).virtual == kind
