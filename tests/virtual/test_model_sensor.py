"""Sensors of the model as a device: entries, values, errors of measurement, faults."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.realtime import VirtualClock
from catenary.virtual import ModelSensor, Plant, Segment, Servo, faults, read_segment
from tests.virtual.bodies import ON_THE_FLOOR
from tests.virtual.main_device import STATION, MainDevice
from tests.virtual.plants import GRAVITY, Time, model

IMU = ("orientation", "gyro", "acceleration")
NAMES = (
    *(f"orientation {axis}" for axis in "wxyz"),
    *(f"gyro {axis}" for axis in "xyz"),
    *(f"acceleration {axis}" for axis in "xyz"),
)


def box(folder: Path, *sensors: ModelSensor, clock: object = "virtual") -> Segment:
    plant = Plant(model(folder, ON_THE_FLOOR), keyframe="turned", held="trunk")
    return Segment([Servo(), *sensors], plant=plant, clock=clock)  # type: ignore[arg-type]


def shown(segment: Segment, position: int = 1) -> np.ndarray:
    """Return the values in the slots of a sensor."""
    sensor = segment[position]
    assert isinstance(sensor, ModelSensor)
    count = sum(sensor.sizes.values())
    raw = [segment.core.slot(position, k) for k in range(count)]
    return np.array(raw, np.uint32).view(np.float32)


def data(segment: Segment) -> np.ndarray:
    assert segment.plant is not None
    return np.array(segment.plant.data.sensordata, np.float32)


def test_main_device_reads_names_and_values(tmp_path: Path) -> None:
    segment = box(tmp_path, ModelSensor(sensors=IMU, name="IMU"))
    with cat.MainDevice(segment) as main:
        inputs = cat.Inputs(main.scan()[1])
        assert inputs.names == NAMES
        with cat.Loop(inputs, period=1e-3) as loop:
            for cycle in loop:
                if cycle.time > 0.2:
                    break
            measured = [inputs[name] for name in NAMES]
    assert measured[:4] == pytest.approx([0.5**0.5, 0, 0, 0.5**0.5], abs=1e-3)
    assert measured[4:] == pytest.approx([0, 0, 0, 0, 0, GRAVITY], abs=0.02)


def test_values_are_those_of_the_model(tmp_path: Path) -> None:
    """The lid turns, and the trunk falls."""
    segment = box(tmp_path, ModelSensor(sensors=("angle", *IMU)))
    servo, time = segment[0], Time(segment)
    assert isinstance(servo, Servo)
    assert segment.plant is not None
    segment.plant.release()
    servo.apply_load(50.0)
    time.pass_by(0.05)
    expected = data(segment)
    assert shown(segment).tolist() == [expected[10], *expected[:10]]
    assert expected[9] == pytest.approx(0, abs=1e-3)  # free fall


def test_values_are_also_objects(tmp_path: Path) -> None:
    segment = box(tmp_path, ModelSensor(sensors=("gyro", "angle")))
    main = MainDevice(segment)
    main.number_stations()
    main.start_mailbox(STATION + 1)
    raw = main.upload(STATION + 1, 0x6010, 1)
    assert isinstance(raw, bytes)
    assert struct.unpack("<f", raw) == pytest.approx((0.5,), abs=1e-3)
    assert main.upload(STATION + 1, 0x6000, 0) == b"\x03"


def test_bias_and_scale(tmp_path: Path) -> None:
    plain = ModelSensor(sensors=("acceleration", "angle"))
    other = ModelSensor(
        sensors=("acceleration", "angle"), bias={"acceleration": 0.5}, scale={"angle": 1000.0}
    )
    segment = box(tmp_path, plain, other)
    Time(segment).pass_by(0.1)
    exact, wrong = shown(segment, 1), shown(segment, 2)
    assert wrong[:3].tolist() == pytest.approx((exact[:3] + 0.5).tolist())
    assert wrong[3] == pytest.approx(1000 * exact[3])


def noises(folder: Path, seed: int) -> np.ndarray:
    segment = box(folder, ModelSensor(sensors=("gyro",), noise={"gyro": 0.01}, seed=seed))
    time, rows = Time(segment), []
    for _ in range(2000):
        time.pass_by(250e-6)
        rows.append(shown(segment) - data(segment)[4:7])
    return np.array(rows)


def test_noise_is_gaussian_independent_and_repeatable(tmp_path: Path) -> None:
    rows = noises(tmp_path, 1)
    assert rows.std(axis=0) == pytest.approx(0.01, rel=0.1)
    assert abs(rows.mean(axis=0)).max() < 0.001
    correlation = np.corrcoef(rows.T)[np.triu_indices(3, 1)]
    assert abs(correlation).max() < 0.1
    assert np.mean(abs(rows) < 0.01) == pytest.approx(0.683, abs=0.03)  # within one deviation
    assert (noises(tmp_path, 1) == rows).all()
    assert (noises(tmp_path, 2) != rows).any()


def test_sensors_of_a_segment_without_motors(tmp_path: Path) -> None:
    with VirtualClock() as clock:
        plant = Plant(model(tmp_path, ON_THE_FLOOR), keyframe="turned", held="trunk")
        Segment([Servo()], plant=plant.part(["hinge"]), clock=clock)
        sensor = Segment([ModelSensor(sensors=("angle",))], plant=plant.part([]), clock=clock)
        Time(sensor).pass_by(0.1)
        assert shown(sensor, 0)[0] == pytest.approx(0.5, abs=1e-3)


# -- faults ---------------------------------------------------------------------------------------


def test_frozen_sensor_is_stuck(tmp_path: Path) -> None:
    """The device stays in OP, and its inputs keep their last values."""
    segment = box(tmp_path, ModelSensor(sensors=("angle",)))
    servo = segment[0]
    assert isinstance(servo, Servo)
    with cat.MainDevice(segment) as main:
        inputs = cat.Inputs(main.scan()[1])
        with cat.Loop(inputs, period=1e-3) as loop:
            next(loop)
            segment.inject(faults.Freeze(device=1))
            servo.apply_load(50.0)
            for cycle in loop:
                if cycle.time > 0.2:
                    break
            assert inputs["angle"] == pytest.approx(0.5, abs=1e-3)
            assert data(segment)[10] > 0.6
            assert segment[1].state == 8


def test_values_return_after_a_loss_of_power(tmp_path: Path) -> None:
    segment = box(tmp_path, ModelSensor(sensors=("angle",)))
    segment.inject(faults.PowerCycle(device=1, for_=0.01))
    Time(segment).pass_by(0.05)
    assert shown(segment)[0] == pytest.approx(0.5, abs=1e-3)


def test_replaced_sensor(tmp_path: Path) -> None:
    segment = box(tmp_path, ModelSensor(sensors=("gyro",)))
    time = Time(segment)
    segment.inject(faults.Swap(device=1, with_=ModelSensor(sensors=("angle",)), at=0.01))
    time.pass_by(0.05)
    assert shown(segment)[0] == pytest.approx(0.5, abs=1e-3)
    segment.inject(faults.Swap(device=1, with_=Servo()))
    time.pass_by(0.05)
    assert isinstance(segment[1], Servo)


def test_exchanged_sensors(tmp_path: Path) -> None:
    """The two devices change places, and keep their sensors."""
    angle, gyro = ModelSensor(sensors=("angle",)), ModelSensor(sensors=("gyro",))
    segment = box(tmp_path, angle, gyro)
    segment.inject(faults.Exchange(device=1, other=2, at=0.01, for_=0.01))
    Time(segment).pass_by(0.05)
    assert (angle.position, gyro.position) == (2, 1)
    assert shown(segment, 2)[0] == pytest.approx(0.5, abs=1e-3)
    assert len(shown(segment, 1)) == 3


def test_replacement_with_unknown_sensors_is_refused(tmp_path: Path) -> None:
    segment = box(tmp_path)
    with pytest.raises(ValueError, match=r"fault swap: with: .* has no sensor 'wrist'"):
        segment.inject(faults.Swap(device=0, with_=ModelSensor(sensors=("wrist",))))
    with pytest.raises(ValueError, match=r"fault swap: with: .* needs a plant"):
        Segment([Servo()]).inject(faults.Swap(device=0, with_=ModelSensor(sensors=("wrist",))))


# -- invalid descriptions -------------------------------------------------------------------------


def test_unknown_sensor(tmp_path: Path) -> None:
    message = "no sensor 'wrist'; its sensors are orientation, gyro, acceleration, angle"
    with pytest.raises(ConfigurationError, match=message):
        box(tmp_path, ModelSensor(sensors=("gyro", "wrist")))


def test_sensor_with_too_many_values(tmp_path: Path) -> None:
    large = ON_THE_FLOOR.replace("<sensor>", '<sensor><user name="skin" dim="253"/>')
    sensor = ModelSensor(sensors=("gyro", "skin"), name="Skin")
    with pytest.raises(ConfigurationError, match=r"Skin has 256 values .*at most 255"):
        Segment([sensor], plant=Plant(model(tmp_path, large), passive=["hinge"]))
    at_most = ModelSensor(sensors=("angle", "skin"))
    Segment([at_most], plant=Plant(model(tmp_path, large), passive=["hinge"]))


def test_segment_of_sensors_needs_an_empty_part(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"the axes are none(.|\n)*plant.part\(\[\]\)"):
        Segment([ModelSensor(sensors=("gyro",))], plant=Plant(model(tmp_path, ON_THE_FLOOR)))


def test_sensor_needs_a_plant() -> None:
    with pytest.raises(ValueError, match=r"IMU needs a plant with the sensors gyro"):
        Segment([ModelSensor(sensors=("gyro",), name="IMU")])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sensors": ()}, "1 to 16 names"),
        ({"sensors": "gyro"}, "not the string 'gyro'"),
        ({"sensors": ("gyro", "gyro")}, "a name twice"),
        ({"sensors": ("gyro",), "noise": {"gyro": -1.0}}, "noise of 'gyro' is out of range"),
        ({"sensors": ("gyro",), "bias": {"angle": 0.1}}, "bias: 'angle' is not in sensors"),
        ({"sensors": ("gyro",), "scale": {"gyro": float("inf")}}, "scale of 'gyro'"),
        ({"sensors": ("gyro",), "seed": -1}, "seed must be 0 to"),
    ],
)
def test_invalid_values(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ModelSensor(**options)  # type: ignore[arg-type]


def test_segment_file(tmp_path: Path) -> None:
    model(tmp_path, ON_THE_FLOOR, "box.xml")
    file = tmp_path / "box.toml"
    file.write_text(
        '[plant]\nmodel = "box.xml"\npassive = ["hinge"]\n[[device]]\nkind = "model_sensor"\n'
        'sensors = ["gyro", "angle"]\nname = "IMU"\nnoise = { gyro = 0.002 }\nseed = 3\n'
    )
    sensor = read_segment(file)[0]
    assert isinstance(sensor, ModelSensor)
    assert (sensor.sensors, sensor.noise, sensor.seed) == (("gyro", "angle"), {"gyro": 0.002}, 3)
    file.write_text(
        file.read_text().replace('"gyro", "angle"', '"wrist"').replace("gyro =", "wrist =")
    )
    with pytest.raises(ConfigurationError, match=r"box.toml: plant: .* no sensor 'wrist'"):
        read_segment(file)
