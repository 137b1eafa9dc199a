"""The program of the humanoid: one loop over both networks, and the tasks in their processes.

A compiled law in each network controls the joints. The body of the loop (`robot.py`) passes actual
values to the tasks, and their commands to the laws. The tasks estimate the state, balance, move
the arms, record, and decide about safety.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack

import body
import laws
import policy
import tasks as jobs
from exchange import Exchange
from networks import Network, Sensors, make_plant, segments
from robot import Robot
from run import Outcome, Setup
from world import History, Meter, Script, World

import catenary as cat
from catenary import control, realtime
from catenary.demo.wires import on_wires

LOOP_COST = 100e-6  # [s] declared execution time of the loop's body, in virtual time
CLOSING = 60.0  # [s] of real time for the tasks to end, at most: the log completes its files
STOP = cat.StopPolicy(raise_faults=False, on_axis_stopped="event")


def make_tasks(setup: Setup, x: Exchange, clock: realtime.VirtualClock | None) -> realtime.Tasks:
    """Return the tasks of the program, by falling priority.

    In virtual time, each declares its execution time, and shares a processor with others. A killed
    task is restarted, except those that the robot cannot do without for a moment: the safety task
    stops it, because they would meet a falling robot.
    """

    def task(
        function: Callable[..., None],
        *more: object,
        rate: tuple[float, int],  # [Hz], priority
        place: tuple[int, float],  # processor, execution time [s]
        on_failure: str = "restart",
    ) -> realtime.Task:
        (hertz, priority), (cpu, cost) = rate, place
        period = max(1 / hertz, setup.period)  # not faster than the loop
        arguments = (cost * setup.virtual, *more)
        options = {"priority": priority, "cpu": cpu if setup.virtual else None}
        return realtime.Task(function, arguments, period=period, on_failure=on_failure, **options)

    model, once = str(setup.model), {"on_failure": "continue"}
    chosen = [
        task(jobs.safety, x, setup.silence, rate=(1000, 95), place=(1, 20e-6), **once),
        task(jobs.estimator, x, model, rate=(2000, 90), place=(1, 100e-6), **once),
        task(jobs.balancing, x, model, rate=(1000, 85), place=(1, 150e-6), **once),
        task(jobs.dynamics, x, model, rate=(4000, 80), place=(2, 60e-6)),
        task(jobs.arm_motion, x, rate=(500, 75), place=(1, 50e-6)),
        task(jobs.base_pose, x, setup.base, rate=(50, 60), place=(2, 100e-6)),
        task(jobs.log, tuple(setup.shares), setup.folder, rate=(10, 50), place=(2, 5e-3), **once),
    ]
    if setup.policy is not None:
        slot = task(jobs.policy_slot, x, model, setup.policy, rate=(100, 70), place=(2, 1e-3))
        chosen.append(slot)
    if setup.ros2:
        given = (x, model, setup.name)
        chosen.append(task(jobs.operator_hand, *given, rate=(500, 65), place=(2, 200e-6)))
    session = realtime.session(best_effort=True)
    return realtime.Tasks(*chosen, clock=clock, session=session, best_effort=True)


def control_loop(place: object, setup: Setup, x: Exchange, tasks: realtime.Tasks) -> Outcome:
    """Run the loop over both networks to the end of the scenario, or to the stop."""
    with ExitStack() as stack:
        plant = make_plant(str(setup.model))
        both = segments(plant, place or "monotonic")
        ends = [(each.first, each.second) for each in both]
        targets = ends if setup.virtual else stack.enter_context(on_wires(both))
        mains = [stack.enter_context(cat.MainDevice(*each)) for each in targets]
        networks = [Network(main, n, setup.silence / 2) for n, main in enumerate(mains)]
        sensors = Sensors.of(mains[1])
        shares = [cat.Share(name, **offer) for name, offer in setup.shares.items()]
        for share in shares:
            stack.enter_context(share)
        robot = Robot(networks, sensors, x, shares[0], round(setup.silence / setup.period))
        world = World(both, plant, robot, tasks)
        requests = (*(network.drives for network in networks), *sensors.requests)
        options = {"period": setup.period, "watchdog": 0.02, "laws": [laws.joints], "sink": shares}
        with cat.Loop(*requests, stop=STOP, **options) as loop:
            for network in networks:
                network.start(loop)
            return iterate(loop, setup, world, x)


def iterate(loop: cat.Loop, setup: Setup, world: World, x: Exchange) -> Outcome:
    """Iterate the open loop, and return the results."""
    script, history, meter = Script(setup.scenario), History(), Meter(world.tasks)
    began, robot = time.perf_counter(), world.robot
    for cycle in loop:
        history.take(cycle.number, world, x)
        if not robot.step(cycle) or not script.step(cycle.time, world):
            break
        cycle.spend(LOOP_COST * setup.virtual)
    operation = robot.operation
    return Outcome(
        setup,
        operation.events,
        history.rows,
        script.began or 0.0,
        [network.timing for network in loop.networks],
        time.perf_counter() - began,
        operation.verdict,
        operation.cause,
        meter.read(),
        world.tasks,
    )


def run(setup: Setup) -> Outcome:
    """Run a scenario with all tasks.

    Raises:
        ValueError: The model is that of another robot.
        ConfigurationError: The policy cannot be used.
        TaskError: A task failed too often.
    """
    body.load_model(setup.model)
    if setup.policy is not None:  # raises an error for an invalid model
        control.Policy(setup.policy, inputs=policy.OBSERVATION, rule=jobs.RULE)
    x = Exchange()
    with ExitStack() as stack:
        clock = stack.enter_context(realtime.VirtualClock()) if setup.virtual else None
        tasks = stack.enter_context(make_tasks(setup, x, clock))
        outcome = tasks.beside(control_loop, setup, x, tasks, priority=90)
        tasks.stop(CLOSING)
    return outcome
