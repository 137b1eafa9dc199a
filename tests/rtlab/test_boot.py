"""A real boot: Debian's kernel, this interpreter, a pair of wires, an hour of time."""

from __future__ import annotations

SCRIPT = """
import json, os, subprocess, sys, time
subprocess.run(["ip", "link", "add", "wire0", "type", "veth", "peer", "name", "wire1"], check=True)
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(80))
before = time.monotonic()
time.sleep(3600)
late = time.monotonic() - before - 3600
print("slept an hour")
found = {"links": sorted(os.listdir("/sys/class/net")), "late": late, "cpus": os.cpu_count()}
open(sys.argv[1], "w").write(json.dumps(found))
"""
SECONDS = 300.0  # of the host's, for a boot that takes ten


def test_an_hour_of_a_real_time_kernel_passes_in_a_boot(rtlab) -> None:
    lines, answer = rtlab.run(SCRIPT, SECONDS)
    assert "slept an hour" in lines
    assert "PREEMPT_RT" in answer["kernel"]
    assert answer["seconds"] > 3600
    found = answer["result"]
    assert found["cpus"] == 1
    assert found["links"] == ["lo", "wire0", "wire1"]
    assert 0 <= found["late"] < 1e-3  # by the guest's own clock, whatever this machine does
