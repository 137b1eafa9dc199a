"""One plant for several segments: one model and one time, in virtual and in real time."""

from __future__ import annotations

import gc
import threading
from collections.abc import Sequence
from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.realtime import VirtualClock
from catenary.virtual import DigitalOutputs, Joint, Plant, PlantPart, Segment, Servo, faults
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import MainDevice
from tests.virtual.plants import DOUBLE, Time, frictionless, model
from tests.virtual.servo_drive import CST, Drive
from tests.virtual.test_plant_time import until
from tests.virtual.test_server import BRD, answer, wire

START = 0.3  # rad


def arm(folder: Path, **options: object) -> Plant:
    """Return a double pendulum without brakes, which swings from both joints at START."""
    joints = [Joint(name, brake=0, start=START) for name in ("shoulder", "elbow")]
    return Plant(model(folder, DOUBLE), joints, **options)  # type: ignore[arg-type]


def motor(segment: Segment) -> Servo:
    servo = segment[0]
    assert isinstance(servo, Servo)
    return servo


def two(plant: Plant, clock: object) -> list[Segment]:
    """Return a segment for the shoulder and one for the elbow."""
    return [
        Segment([frictionless()], plant=plant.part([name]), clock=clock)  # type: ignore[arg-type]
        for name in ("shoulder", "elbow")
    ]


def swing(segments: Sequence[Segment], clock: VirtualClock, torques: Sequence[float]) -> bytes:
    """Load the motors for 0.4 s while the time of all links passes. Return the state."""
    times = [Time(segment) for segment in segments]
    for step in range(40):
        for segment, torque in zip(segments, torques, strict=True):
            motor(segment).apply_load(torque * (step % 7 - 3))
        for time in times:
            time.pass_by(0.01 if time is times[0] else 0.0)
    plant = segments[0].plant
    assert plant is not None
    assert plant.data.time == pytest.approx(0.4)
    return bytes(plant.data.qpos.tobytes() + plant.data.qvel.tobytes())


def test_two_segments_move_the_model_like_one(tmp_path: Path) -> None:
    """The states are equal to the last bit, also when the run is repeated."""
    states = set()
    for _ in range(2):
        with VirtualClock() as clock:
            states.add(swing(two(arm(tmp_path), clock), clock, (0.2, -0.1)))
    with VirtualClock() as clock:
        servos = [frictionless(), frictionless()]
        whole = Segment(servos, plant=arm(tmp_path), clock=clock)
        time = Time(whole)
        for step in range(40):
            for servo, torque in zip(servos, (0.2, -0.1), strict=True):
                servo.apply_load(torque * (step % 7 - 3))
            time.pass_by(0.01)
        assert whole.plant is not None
        states.add(whole.plant.data.qpos.tobytes() + whole.plant.data.qvel.tobytes())
    assert len(states) == 1


def test_encoders_of_all_segments_show_the_same_step(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        plant = arm(tmp_path)
        segments = two(plant, clock)
        Time(segments[1]).pass_by(0.1)
        assert [motor(s).position_rad for s in segments] == plant.data.qpos.tolist()
        assert plant.data.qpos[0] != START
        assert plant.steps == 400


def test_part_without_an_open_link_moves_with_the_others(tmp_path: Path) -> None:
    """Its applications run, too: a fault at 50 ms switches its device off."""
    with VirtualClock() as clock:
        first, second = two(arm(tmp_path), clock)
        second.inject(faults.PowerCycle(device=0, at=0.05, for_=0.02))
        time = Time(first)
        time.pass_by(0.06)
        assert not second.core.powered(0)
        time.pass_by(0.02)
        assert second.core.powered(0)
        assert [event.what for event in second.fault_log] == ["begins", "ends"]


def test_closed_and_reopened_link(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        plant = arm(tmp_path)
        first, second = two(plant, clock)
        one, other = first.open_link(), second.open_link()
        one.wait_until(10_000_000, False)
        other.close()
        one.wait_until(20_000_000, False)
        other = second.open_link()
        other.wait_until(30_000_000, False)
        assert plant.steps == 120
        assert motor(second).position_rad == plant.data.qpos[1]
        one.close()
        other.close()


def test_closed_network_loses_its_watchdog_and_its_torque(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        first, second = two(arm(tmp_path), clock)
        servo = motor(second)
        drive = Drive(servo, segment=second)
        drive.enable(CST)
        drive.torque = 500
        assert drive.cycle(3).torque == 500
        drive.main.link.close()
        time = Time(first)
        time.pass_by(0.05)
        assert (servo.state, servo.torque_nm != 0) == (8, True)
        time.pass_by(0.1)
        assert (servo.state, servo.torque_nm) == (0x14, 0.0)  # SAFE-OP with an error


def test_segment_that_the_program_forgets(tmp_path: Path) -> None:
    """The plant keeps its devices alive."""
    with VirtualClock() as clock:
        plant = arm(tmp_path)
        segments = two(plant, clock)
        time = Time(segments[0])
        time.pass_by(0.1)
        before = float(plant.data.qpos[1])
        del segments
        gc.collect()
        time.pass_by(0.1)
        assert plant.steps == 800
        assert plant.data.qpos[1] != before


def test_two_loops_in_threads_share_the_plant(tmp_path: Path) -> None:
    """Two participants of one clock wait for different times. The result does not depend on it."""
    states = set()
    for _ in range(2):
        with VirtualClock() as clock:
            plant = arm(tmp_path)
            participants = [clock.participate(), clock.participate()]
            segments = [
                Segment([frictionless()], plant=plant.part([name]), clock=participant)
                for name, participant in zip(("shoulder", "elbow"), participants, strict=True)
            ]
            threads = [
                threading.Thread(target=walk, args=(segment, participant, period))
                for segment, participant, period in zip(
                    segments, participants, (1_000_000, 700_000), strict=True
                )
            ]
            for thread in threads:
                thread.start()
            clock.wait_until(200_000_000)
            for thread in threads:
                thread.join(20)
            states.add(plant.data.qpos.tobytes())
            assert plant.data.time == pytest.approx(0.0995, abs=1e-3)
    assert len(states) == 1


def walk(segment: Segment, participant: object, period: int) -> None:
    """Use a link in steps of `period` for 0.1 s, and leave the clock."""
    link = segment.open_link()
    while link.now() < 100_000_000 - period:
        link.wait_until(link.now() + period, False)
    participant.leave()  # type: ignore[attr-defined]


def test_failure_of_one_part_is_reported_by_the_others(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        first, second = two(arm(tmp_path), clock)
        motor(second).apply_load(3e9)
        with pytest.raises(ConfigurationError, match="joint 'elbow' exceeded 1e6 rad/s"):
            Time(first).pass_by(0.01)
        with pytest.raises(ConfigurationError, match="joint 'elbow' exceeded 1e6 rad/s"):
            Time(second).pass_by(0.01)


def test_exception_in_the_application_of_another_part(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        first, second = two(arm(tmp_path), clock)
        second.service.agenda.at(5_000_000, lambda: 1 // 0)
        time = Time(first)
        with pytest.raises(ZeroDivisionError):
            time.pass_by(0.01)
        time.pass_by(0.01)  # the failed action is removed
        Time(second).pass_by(0.01)


def test_different_clocks(tmp_path: Path) -> None:
    plant = arm(tmp_path)
    with VirtualClock() as one, VirtualClock() as other:
        first = Segment([frictionless()], plant=plant.part(["shoulder"]), clock=one)
        Segment([frictionless()], plant=plant.part(["elbow"]), clock=other)
        with pytest.raises(ConfigurationError, match=r"different clocks(.|\n)*same VirtualClock"):
            Time(first).pass_by(0.01)


@pytest.mark.parametrize("clocks", [("virtual", "virtual"), ("virtual", "monotonic")])
def test_private_clocks_are_refused(tmp_path: Path, clocks: tuple[str, str]) -> None:
    plant = arm(tmp_path)
    Segment([frictionless()], plant=plant.part(["shoulder"]), clock=clocks[0])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"need one clock; pass the same VirtualClock"):
        Segment([frictionless()], plant=plant.part(["elbow"]), clock=clocks[1])  # type: ignore[arg-type]


def test_joint_can_belong_to_only_one_segment(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        plant = arm(tmp_path)
        Segment([frictionless()], plant=plant.part(["shoulder"]), clock=clock)
        with pytest.raises(ValueError, match="already belongs to another segment"):
            Segment([frictionless(axes=2)], plant=plant, clock=clock)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["wrist"], "'wrist' is not a joint with a motor; the joints are shoulder, elbow"),
        (["elbow", "elbow"], "'elbow' is named twice"),
        ("elbow", r"a sequence of names, not the string 'elbow'; use \['elbow'\]"),
    ],
)
def test_names_of_a_part(tmp_path: Path, names: list[str], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        arm(tmp_path).part(names)


def test_order_of_the_axes_is_that_of_the_part(tmp_path: Path) -> None:
    plant = Plant(
        model(tmp_path, DOUBLE), [Joint("shoulder", start=0.1), Joint("elbow", start=0.2)]
    )
    servo = frictionless(axes=2)
    segment = Segment([servo], plant=plant.part(["elbow", "shoulder"]))
    assert [servo.axis_position(k) for k in range(2)] == [0.2, 0.1]
    assert segment.plant is plant


def test_number_of_axes_is_that_of_the_part(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="1 joints have motors, but the segment has 2"):
        Segment([Servo(axes=2)], plant=arm(tmp_path).part(["elbow"]))


def test_joint_without_a_segment_is_locked(tmp_path: Path) -> None:
    plant = arm(tmp_path)
    segment = Segment([frictionless()], plant=plant.part(["shoulder"]))
    Time(segment).pass_by(0.2)
    assert plant.data.joint("elbow").qpos[0] == pytest.approx(START, abs=1e-4)
    assert abs(motor(segment).position_rad - START) > 0.05


def test_segment_after_the_first_step_is_refused(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        plant = arm(tmp_path)
        Time(Segment([frictionless()], plant=plant.part(["shoulder"]), clock=clock)).pass_by(0.01)
        with pytest.raises(ValueError, match="already moves; create all its segments before"):
            Segment([frictionless()], plant=plant.part(["elbow"]), clock=clock)


def test_replaced_servo_of_one_part(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        plant = arm(tmp_path)
        first, second = two(plant, clock)
        new = frictionless()
        second.inject(faults.Swap(device=0, with_=new, at=0.01))
        time = Time(first)
        time.pass_by(0.1)
        assert new.position_rad == plant.data.qpos[1] != START
        second.inject(faults.Swap(device=0, with_=DigitalOutputs()))
        time.pass_by(0.1)
        assert motor(first).position_rad == plant.data.qpos[0]


def test_push_by_any_segment(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        plant = arm(tmp_path)
        segments = two(plant, clock)
        time = Time(segments[0])
        segments[1].push("lower", (0.0, 0.0, 30.0), for_=0.05)
        time.pass_by(0.02)
        assert plant.data.body("lower").xfrc_applied[2] == 30.0
        time.pass_by(0.05)
        assert not plant.data.xfrc_applied.any()


# -- real time -------------------------------------------------------------------------------------


def test_real_time_until_the_last_link_is_closed(tmp_path: Path) -> None:
    plant = arm(tmp_path)
    first, second = two(plant, "monotonic")
    one, other = first.open_link(), second.open_link()
    until(lambda: plant.steps > 20)
    one.close()
    before = plant.steps
    until(lambda: plant.steps > before + 20)
    other.close()
    ended = plant.steps
    threading.Event().wait(0.01)
    assert plant.steps == ended
    assert [motor(s).position_rad for s in (first, second)] == plant.data.qpos.tolist()
    link = second.open_link()
    until(lambda: plant.steps > ended + 20)
    link.close()


def test_thread_of_the_plant_ends_before_the_services(tmp_path: Path) -> None:
    """It writes to the event descriptors that the services close."""
    plant, ends = arm(tmp_path), []
    first, _ = two(plant, "monotonic")

    class Probe:
        def acquire(self) -> None: ...

        def release(self) -> None:
            names = {thread.name for thread in threading.enumerate()}
            ends.append("virtual-plant" in names)

    plant.services.insert(0, Probe())
    first.open_link().close()
    assert ends == [False]


def test_real_time_under_frames_on_both_networks(tmp_path: Path) -> None:
    """Two threads exchange frames on both segments while the plant steps them."""
    plant = arm(tmp_path)
    segments = two(plant, "monotonic")
    mains = [MainDevice(segment) for segment in segments]
    counters: list[int] = []

    def exchange(main: MainDevice) -> None:
        counters.extend(
            main.exchange(EcatCommand.BRD, 0, 0x0130, bytes(2)).working_counter for _ in range(300)
        )

    threads = [threading.Thread(target=exchange, args=(main,)) for main in mains]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    until(lambda: plant.steps > 100)
    assert counters == [1] * 600
    for main in mains:
        main.link.close()
    assert [motor(s).position_rad for s in segments] == plant.data.qpos.tolist()


def test_replaced_servo_in_real_time(tmp_path: Path) -> None:
    plant = arm(tmp_path)
    first, second = two(plant, "monotonic")
    main, new = MainDevice(first), frictionless()
    second.inject(faults.Swap(device=0, with_=new))
    until(lambda: new.position >= 0 and new.position_rad not in (0.0, START))
    main.link.close()
    assert new.position_rad == plant.data.qpos[1]


def test_served_parts(tmp_path: Path, veth: tuple[str, str]) -> None:
    """One part is served on an interface; the other has no link."""
    from catenary.virtual import Server

    plant = arm(tmp_path)
    first, second = two(plant, "monotonic")
    with Server(first, veth[1], max_age=None), wire(veth[0]) as near:
        for _ in range(20):
            near.send(BRD)
            assert answer(near) == 1
        until(lambda: plant.steps > 100)
    assert motor(second).position_rad == plant.data.qpos[1]


def test_part_is_a_public_type(tmp_path: Path) -> None:
    part = arm(tmp_path).part()
    assert isinstance(part, PlantPart)
    assert [joint.name for joint in part.joints] == ["shoulder", "elbow"]
