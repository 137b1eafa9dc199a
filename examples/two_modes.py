"""One axis holds its position (CSP), then moves by torque (CST) in the same loop."""

import sys

import catenary as cat

with cat.MainDevice(sys.argv[1] if len(sys.argv) > 1 else "virtual") as main:
    arm = cat.Drives(
        main.scan().drives,
        mode="csp",
        other_modes=["cst"],
        counts_per_turn=2**20,
        velocity_limit=5.0,
    )
    with cat.Loop(arm, period=1e-3) as loop:
        for cycle in loop:
            if cycle.time > 2.0:
                break
            if cycle.time > 1.0:
                arm.switch("cst", axes=[0])
                arm.target.torque[0] = 0.1 - 0.02 * arm.actual.velocity[0]  # [N·m]
        print(f"axis 0 turned to {arm.actual.position[0]:.3f} rad")
