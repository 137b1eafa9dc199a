"""Move an axis by a force sensor, and stop when its samples are stale: `python sensors.py`.

A thread simulates a force/torque box that sends RDT by UDP. It is switched off after 2 s. The
limits are generous, so that the example runs on any machine.
"""

import socket
import struct
import threading
import time

import catenary as cat
from catenary import sensors

NAME, RATE, MAX_AGE = "demo.wrist", 100.0, 0.5  # [Hz], [s]


def simulate_box(box: socket.socket) -> None:
    _, client = box.recvfrom(100)  # the request to start
    for number in range(1, 201):
        box.sendto(struct.pack(">III6i", number, number, 0, 0, 0, 2_000_000, 0, 0, 0), client)
        time.sleep(1 / RATE)


def follow(wrist: sensors.SensorReader) -> None:
    wrist.wait(10.0)  # for the first sample
    segment = cat.Segment([cat.virtual.Servo()], clock="monotonic")
    stop = cat.StopPolicy(late_limit=0)
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with cat.Loop(arm, period=2e-3, stop=stop) as loop:
            for _ in loop:
                now = wrist.read()  # the newest sample; never waits
                if not now.valid:
                    break  # the axis holds its last target until the loop closes
                arm.target.position[:] += 5e-4 * now["force"][2]  # 0.25 rad/s per newton
        print(f"axis 0 at {arm.actual.position[0]:.2f} rad; stopped: {now.reason}")


if __name__ == "__main__":
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as box:
        box.bind(("127.0.0.1", 0))
        threading.Thread(target=simulate_box, args=(box,), daemon=True).start()
        ft = sensors.Rdt(RATE)
        options = sensors.Options(silence=MAX_AGE)
        with (
            sensors.SensorShare(NAME, ft.channels, ft.rate) as share,
            sensors.Task(ft, sensors.Udp(*box.getsockname()), share, options=options),
            sensors.attach(NAME, MAX_AGE) as wrist,
        ):
            follow(wrist)
