import math

import catenary as cat

with cat.Machine("machine.toml") as machine:  # open, scan, verify identities
    arm, gripper = machine.drives["arm"], machine.drives["gripper"]
    valves, imu = machine.process_data["valves"], machine.process_data["imu"]
    with machine.loop() as loop:
        loop.wait(arm.move_to([0, -0.5, 1.2, 0, 0.6, 0], velocity=0.5))
        valves["clamp"] = True
        loop.wait(gripper.move_to(0.020))  # [m]
        start = arm.target.position[5]
        for cycle in loop:
            arm.target.position[5] = start + 0.1 * math.sin(cycle.time)
            if cycle.time > 5.0 or abs(imu["rate_z"]) > 1.0:
                break
