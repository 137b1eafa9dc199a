"""The hand-over: consistent vectors, the latest value, private buffers."""

import ctypes
import gc

import numpy as np
import pytest

from tests.core.hammer import load_hammer
from tests.core.rig import axis, bench


def test_no_torn_vector_in_a_million_exchanges() -> None:
    torn, backward = ctypes.c_uint64(), ctypes.c_uint64()
    taken = ctypes.c_uint64(1_000_000)
    load_hammer().hammer_triple(taken, ctypes.byref(torn), ctypes.byref(backward))
    assert (torn.value, backward.value) == (0, 0)


def test_a_packet_ring_keeps_order_and_bytes() -> None:
    assert load_hammer().hammer_ring(ctypes.c_uint64(200_000)) == 0


@pytest.mark.parametrize("requests", [False, True])
def test_a_pointer_is_served_once_and_never_freed_while_it_is_used(requests: bool) -> None:
    wrong, backward = ctypes.c_uint64(), ctypes.c_uint64()
    count = ctypes.c_uint64(20_000)
    served = load_hammer().hammer_pointer(
        count, ctypes.c_int(requests), ctypes.byref(wrong), ctypes.byref(backward)
    )
    assert served > 0
    assert (wrong.value, backward.value) == (0, 0)


def test_actual_values_are_read_only_and_constant_between_steps() -> None:
    b = bench(axis(0))
    b.engine.run(1)
    with pytest.raises(ValueError, match="read-only"):
        b.actual_position[0] = 1.0
    before = b.actual_position.copy()
    b.drives[0].position = 500
    b.engine.spend(5_000_000)
    assert (b.actual_position == before).all()
    b.engine.next()
    assert b.actual_position[0] == pytest.approx(0.5)


def test_buffers_have_the_types_and_lengths_of_the_views() -> None:
    b = bench(axis(0), axis(1))
    formats = {name: view.format for name, view in b.engine.buffers.items()}
    assert formats == {
        **dict.fromkeys(("actual_position", "actual_velocity", "actual_torque"), "d"),
        **dict.fromkeys(("target_position", "target_velocity", "target_torque"), "d"),
        **dict.fromkeys(("input_reals", "output_reals"), "d"),
        **dict.fromkeys(("input_integers", "output_integers"), "q"),
        **dict.fromkeys(("statusword", "controlword_bits", "unit_counter"), "H"),
        **dict.fromkeys(("mode_actual", "mode_target"), "b"),
        **dict.fromkeys(("axis_state", "axis_flags", "requested_state", "stop_reason"), "B"),
        "jogged": "B",
        "stop_cycle": "Q",
        **dict.fromkeys(("input_bits", "output_bits", "unit_valid"), "B"),
        **dict.fromkeys(("input_bytes", "output_bytes"), "B"),
        "request": "I",
    }
    assert len(b.engine.buffers["target_position"]) == 2
    assert len(b.engine.buffers["input_reals"]) == 0


def test_buffers_outlive_the_engine() -> None:
    b = bench(axis(0))
    b.drives[0].position = 1000
    b.engine.run(1)
    view = np.asarray(b.engine.buffers["actual_position"])
    b.engine.stop()
    del b
    gc.collect()
    assert view[0] == pytest.approx(1.0)


def test_absent_quantities_read_nan_and_velocity_is_estimated() -> None:
    b = bench(axis(0, actual_velocity=None, actual_torque=None))
    b.drives[0].position = 100
    b.engine.run(1)
    assert b.actual_velocity[0] == 0.0
    assert np.isnan(b.actual_torque[0])
    b.drives[0].position = 103
    b.engine.run(1)
    assert b.actual_velocity[0] == pytest.approx(3.0)  # 0.003 rad in 1 ms
