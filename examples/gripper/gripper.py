"""A gripper of two axes at 2 kHz: homing, compliant fingers, and contact without a force sensor.

It runs in virtual time and needs pip install 'catenary[law,sim]'.
"""

from itertools import islice
from math import sqrt
from pathlib import Path

import numpy as np

import catenary as cat
from catenary import control
from catenary.virtual import Joint, Plant, Segment, Servo

PERIOD = 500e-6
INERTIA, VISCOUS, COULOMB = 2.7e-4, 2e-3, 0.01  # of a finger with its motor: kg·m², SI
PUSH = 0.1  # [N·m], torque of a hand

seeking = control.Homing(2, velocity=-0.8, torque=0.08, travel=2.0)
speed = control.Pid(2, 0.02, 0.5, limit=0.12)
reference = control.LowPass(2, 250.0, PERIOD)  # for the raw goals
outside = control.Residual(2, gain=150.0, inertia=INERTIA)
rubbing = control.Friction(2, VISCOUS, COULOMB)
collision = control.Threshold(2, limit=0.03, time=1e-3)


@cat.law
def home(actual, target, memory, parameters):  # the three phases, by the commanded torque
    seek, loop = control.part(memory, 0), control.part(memory, 1)
    way, gains, dt = control.part(parameters, 0), control.part(parameters, 1), actual.dt
    for i in range(actual.n):
        wanted = control.homing(seek, way, i, actual.position[i], target.torque[i], dt)
        target.torque[i] = control.pid(loop, gains, i, wanted, actual.velocity[i], 0.0, dt)
    return control.homed(seek)


@cat.law
def grip(actual, target, memory, parameters, time):
    spring, smooth, felt = control.part(memory, 0), control.part(memory, 1), control.part(memory, 2)
    beyond, way, hit = control.part(memory, 3), control.part(memory, 4), control.part(memory, 5)
    goal, closing = control.part(parameters, 5)[0], control.part(parameters, 5)[1]
    for i in range(actual.n):
        q, v = actual.position[i], actual.velocity[i]
        known = actual.torque[i] - control.friction(control.part(parameters, 3), i, v)
        push = control.residual(felt, control.part(parameters, 2), i, known, v, actual.dt)
        if hit[i] == 0.0 and closing > 0.0:
            way[i] += closing * actual.dt
            if control.threshold(beyond, control.part(parameters, 4), i, push, actual.dt):
                hit[i], way[i] = time, q - goal  # stop closing
        wanted = control.low_pass(smooth, control.part(parameters, 1), i, goal + way[i])
        target.torque[i] = control.impedance(
            spring, control.part(parameters, 0), i, wanted, 0.0, 0.0, 0.0, q, v, actual.dt
        )


def gripping(stiffness, closing=0.0):
    """Return the parameters of `grip` for a stiffness [N·m/rad] and a closing speed [rad/s]."""
    damping = 2 * sqrt(stiffness * INERTIA)
    finger = control.Impedance(2, stiffness, damping, INERTIA, VISCOUS, 100.0, COULOMB, 0.4)
    blocks = (finger, reference, outside, rubbing, collision)
    return control.join(*(block.parameters for block in blocks), [0.0, closing])


def seen_stiffness():
    """Push both fingers twice. Return torque over displacement [N·m/rad]."""
    places = []
    for push in (PUSH, 2 * PUSH, 0.0):
        for axis in range(2):
            servo.apply_load(push, axis)
        places += [arm.actual.position.copy() for cycle in islice(loop, 2000)][-1:]
    return PUSH / (places[1] - places[0])


servo = Servo(axes=2, inertia=1e-4, viscous_friction=VISCOUS, coulomb_friction=COULOMB)
plant = Plant(Path(__file__).with_name("gripper.xml"), [Joint("left"), Joint("right")])
segment = Segment([servo], plant=plant)
with cat.MainDevice(segment) as main:
    arm = cat.Drives(main.scan().drives, mode="cst", counts_per_turn=2**20, velocity_limit=50.0)
    with cat.Loop(arm, period=PERIOD, laws=[home, grip]) as loop:
        memory = control.join(seeking.memory, speed.memory)
        memory = loop.run(home, memory, control.join(seeking.parameters, speed.parameters))
        found = control.stops(control.part(memory, 0))
        for name in ("open", "closed", "meeting"):
            print(f"{name} [rad]:", *getattr(found, name).round(3))

        states = [block.memory for block in (reference, outside, collision)]
        kept = control.join(np.zeros(6), *states, np.zeros(2), np.zeros(2))
        run = loop.start(grip, kept, gripping(2.0))
        for _ in islice(loop, 4000):  # 2 s, in which the fingers move to their goals
            pass
        for stiffness in (2.0, 4.0):
            run.parameters = gripping(stiffness)  # changed while it runs
            print(f"stiffness [N·m/rad]: {stiffness}, measured", *seen_stiffness().round(2))
        print("offset by friction [mrad]:", *(1e3 * arm.actual.position).round(2))

        plant.data.mocap_pos[0] = 0.0, 0.1, 0.0  # put an object between the fingers
        run.parameters = gripping(4.0, closing=1.0)
        touched = next(cycle.time for cycle in loop if plant.data.ncon)
        felt = next(cycle.time for cycle in loop if run.memory[-2:].all())
        print(
            f"felt {1e3 * (felt - touched):.1f} ms after contact, at", *run.memory[-4:-2].round(3)
        )
