"""A measured loop with the interface of PyIgH: receive, process, compute, queue, send.

python examples/pyigh_loop.py igh:0     on the IgH kernel master
python examples/pyigh_loop.py           on virtual drives
"""

import statistics
import sys
import time

from catenary.pyigh import MasterBase, SlaveServo

PERIOD_NS = 1_000_000
CYCLES = 2000
target = sys.argv[1] if len(sys.argv) > 1 else "virtual"

with MasterBase(target, period=PERIOD_NS * 1e-9) as master:
    servos = [SlaveServo(sub.position) for sub in master.main.subs.drives]
    for servo in servos:
        master.ecat_init_slave(servo)
    master.ecat_activate_domain()
    master.ecat_activate_master()
    in_python, goals = [], dict[SlaveServo, int]()
    for cycle in range(CYCLES):
        master.wait()
        master.ecat_master_receive()
        master.ecat_domain_process()
        begun = time.perf_counter_ns()
        for servo in servos:
            if servo.enable():
                goals[servo] = goals.get(servo, servo.read_position()) + 5
                servo.set_position(goals[servo])
        in_python.append(time.perf_counter_ns() - begun)
        master.ecat_domain_queue()
        master.ecat_write_apptime(cycle * PERIOD_NS)
        master.ecat_master_send()
    print(f"{len(servos)} servos, {len(goals)} enabled, status {master.ecat_master_status()}")
    print(f"in Python: {statistics.median(in_python) / 1e3:.1f} us per cycle")
    for servo in servos:
        servo.disable()
