"""Read the state of a loop in another process, and command one of its axes for a while.

python examples/attach_from_another_process.py        # with a virtual arm in a separate process
python examples/attach_from_another_process.py arm    # with yours: cat.Share("arm"), share.apply
"""

import multiprocessing
import sys
from multiprocessing.synchronize import Event

import catenary as cat


def move(name: str, started: Event) -> None:
    """Run a loop of two axes in virtual time. Other processes may command them."""
    with cat.MainDevice(cat.Segment([cat.virtual.Servo(), cat.virtual.Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with cat.Share(name) as share, cat.Loop(arm, period=1e-3, sink=share) as loop:
            started.set()
            while not share.apply(arm):  # until a client releases its axes or ends; they then hold
                next(loop)


def read_and_command(name: str) -> None:
    with cat.attach(name) as arm, arm.lease(axes=[0], for_=30.0) as command:
        while arm.wait(timeout=10.0) and arm.read()["position"][0] < 0.1:
            command.send(position=arm.read()["commanded_position"][:1] + 1e-4)
        now = arm.read()
        print(f"cycle {now['number']}: {arm.layout.axes[0]} at {now['position'][0]:.3f} rad")
        rows, lost = arm.rows(after=now["number"] - 100)
        print(f"{len(rows)} cycles, {lost} lost, fastest {rows['velocity'][:, 0].max():.2f} rad/s")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        read_and_command(sys.argv[1])
    else:
        started = multiprocessing.Event()
        robot = multiprocessing.Process(target=move, args=("example", started), daemon=True)
        robot.start()
        started.wait(60.0)
        read_and_command("example")
        robot.join()
