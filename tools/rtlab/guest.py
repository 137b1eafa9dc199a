# The first process of the guest, and its only one that nobody asked for: makes a system of the
# kernel, runs the commands it was handed, says what came out and turns the machine off. It stands
# alone: nothing of this folder is in the guest but this file.
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

MOUNTS = (  # /tmp is the root's own: the working copy may lie in it
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
    "CATENARY_PRIVATE_NETWORK": "inside",  # the whole machine is
    "CATENARY_BENCH_PROGRAMS": "/compiled",
    "CATENARY_LIBETHERCAT": "/igh/libethercat.so.1",  # where TABLE=igh has one
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",  # one run is to be as another
    "PYTHONUNBUFFERED": "1",
}
RB_AUTOBOOT = 0x01234567  # QEMU runs with -no-reboot: it ends
INIT_MODULE = 175  # the system call, x86-64

libc = ctypes.CDLL(None, use_errno=True)


def main() -> None:
    print("rtlab: the guest is up", flush=True)  # its machine is made anew where this is missing
    job = json.loads(base64.b64decode(os.environ["RTLAB_JOB"]))
    make_system()
    # Real-time tasks may have all of the processor (-1), as on a machine tuned by
    # docs/how_to/doctor.md.
    runtime = job.get("real_time_us", -1)  # [us] of every second
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
    """One benchmark; what it leaves in its file is the result."""
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
    """One line of JSON on the second serial line."""
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
