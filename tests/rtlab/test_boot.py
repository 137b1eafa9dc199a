"""A real boot with Debian's kernel, this interpreter, a veth pair and an hour of guest time."""

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
SECONDS = 300.0  # host time; a boot takes about 10 s


def test_an_hour_with_a_real_time_kernel(rtlab) -> None:
    lines, answer = rtlab.run(SCRIPT, SECONDS)
    assert "slept an hour" in lines
    assert "PREEMPT_RT" in answer["kernel"]
    assert answer["seconds"] > 3600
    found = answer["result"]
    assert found["cpus"] == 1
    assert found["links"] == ["lo", "wire0", "wire1"]
    assert 0 <= found["late"] < 1e-3  # by the guest's clock, which does not depend on this machine
