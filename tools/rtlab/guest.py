# The first process of the guest. It sets up the system, runs its commands, reports the results and
# turns the machine off. It imports nothing from this folder, which is not in the guest.
import base64
import ctypes
import json
import os
import subprocess
import sys
import termios
import time
import traceback
import tty
from pathlib import Path
from typing import Any

MOUNTS = (  # not /tmp, because it may contain the working copy
    ("proc", "/proc"),
    ("sysfs", "/sys"),
    ("devtmpfs", "/dev"),
    ("tmpfs", "/dev/shm"),
)
RESULTS = "/dev/ttyS1"
ENVIRONMENT = {
    "HOME": "/root",
    "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
    "LC_ALL": "C.UTF-8",
    "CATENARY_PRIVATE_NETWORK": "inside",  # the whole machine is private
    "CATENARY_BENCH_PROGRAMS": "/compiled",
    "CATENARY_LIBETHERCAT": "/igh/libethercat.so.1",  # only for TABLE=igh
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",  # all runs must be equal
    "PYTHONUNBUFFERED": "1",
}
RB_AUTOBOOT = 0x01234567  # ends QEMU, which runs with -no-reboot
INIT_MODULE = 175  # the system call, x86-64

libc = ctypes.CDLL(None, use_errno=True)


def main() -> None:
    print("rtlab: the guest is up", flush=True)  # the host restarts the machine if this is missing
    job = json.loads(base64.b64decode(os.environ["RTLAB_JOB"]))
    make_system()
    # By default, real-time tasks may use the whole processor, as on a machine tuned by
    # docs/how_to/doctor.md.
    runtime = job.get("real_time_us", -1)  # [us] per second; -1 for no limit
    Path("/proc/sys/kernel/sched_rt_runtime_us").write_text(str(runtime))
    say(run(job))


def make_system() -> None:
    for kind, path in MOUNTS:
        Path(path).mkdir(exist_ok=True)
        checked(libc.mount(kind.encode(), path.encode(), kind.encode(), 0, None), f"mount {path}")
    for module in sorted(Path("/modules").iterdir()):
        content = module.read_bytes()
        checked(libc.syscall(INIT_MODULE, content, len(content), b""), f"module {module.name}")
    subprocess.run(["/sbin/ip", "link", "set", "lo", "up"], env=ENVIRONMENT, check=True)


def checked(status: int, what: str) -> None:
    if status != 0:
        raise OSError(ctypes.get_errno(), f"{what}: {os.strerror(ctypes.get_errno())}")


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Run one benchmark, and return the content of its file as the result."""
    file = Path("/results", job["name"])
    arguments = [str(file) if each == "FILE" else each for each in job["arguments"]]
    started = time.monotonic()
    done = subprocess.run(arguments, cwd=job["folder"], env=ENVIRONMENT, check=False)
    return {
        "kernel": " ".join(os.uname()[2:4]),
        "status": done.returncode,
        "seconds": round(time.monotonic() - started, 3),  # of virtual time
        "result": json.loads(file.read_text()) if file.exists() else None,
    }


def say(answer: dict[str, Any]) -> None:
    """Write one line of JSON to the second serial port."""
    with open(RESULTS, "wb", buffering=0) as line:
        tty.setraw(line.fileno())
        line.write(json.dumps(answer).encode() + b"\n")
        termios.tcdrain(line.fileno())


try:
    main()
except BaseException as error:  # the first process must not end: the kernel would panic
    print(f"rtlab: {type(error).__name__}: {error}", flush=True)
    traceback.print_exc()
finally:
    sys.stdout.flush()
    os.sync()
    libc.reboot(RB_AUTOBOOT)
