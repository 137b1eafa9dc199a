"""Requests of a client, against a loop in the background."""

from __future__ import annotations

import os
import threading
import time

import pytest

import catenary as cat
from catenary.errors import LoopError, ResponseTimeout, SdoAbort, ShareError
from catenary.remote import Client, connect
from tests.remote.programs import Running, program

SERVO = 1
WINDOW = 0x6065  # following error window


def test_hello_names_the_program(client: Client, running: Running) -> None:
    found = client.hello()
    assert (found.pid, found.share, found.period) == (os.getpid(), running.name, 1e-3)
    assert found.virtual
    assert found.background
    assert found.networks == 1


def test_devices_have_states_ports_and_axes(client: Client, running: Running) -> None:
    coupler, servo, outputs = client.devices()
    assert [each.position for each in (coupler, servo, outputs)] == [0, 1, 2]
    assert {each.state for each in (coupler, servo, outputs)} == {"OP"}
    assert servo.axes == list(running.arm.names)
    assert (servo.parent, servo.coe, coupler.coe) == (0, True, False)
    assert servo.ports[0].link
    assert not outputs.ports[1].link


def test_axes_have_limits(client: Client) -> None:
    (axis,) = client.axes()
    assert (axis.device, axis.unit, axis.velocity_limit, axis.mode) == (SERVO, "rad", 1.0, 8)
    assert axis.position_min is None


def test_an_object_is_written_and_read_with_the_type_of_the_device(client: Client) -> None:
    written = client.sdo_write(SERVO, WINDOW, 0, "4321")
    assert (written.type, written.value) == ("UDINT", 4321)
    found = client.sdo_read(SERVO, WINDOW)
    assert (found.data, found.value, found.text) == (b"\xe1\x10\x00\x00", 4321, "4321")


def test_the_dictionary_comes_in_pages(client: Client) -> None:
    first = client.objects(SERVO, count=10)
    assert first.next is not None
    second = client.objects(SERVO, first.next, 10)
    assert {each.index for each in first.entries} < set(range(first.next + 1))
    assert min(each.index for each in second.entries) > first.next
    device_type = first.entries[0]
    assert (device_type.index, device_type.type, device_type.access) == (0x1000, "UDINT", "r")
    assert (device_type.minimum, device_type.maximum) == (0, 2**32 - 1)


def test_registers_are_read(client: Client) -> None:
    assert client.registers(SERVO, 0x0130, 2) == b"\x08\x00"


def test_diagnosis_and_counters(client: Client) -> None:
    client.clear_counters()
    assert client.diagnosis().problems == []
    assert client.emergencies(SERVO) == []


def test_timing_with_histograms(client: Client) -> None:
    found = client.timing(histograms=True)
    assert found.counters["cycles"] > 0
    counted = sum(count for _, _, count in found.histograms["period"])
    assert counted >= found.figures["period"].count > 0


def test_clocks_are_empty_without_clocks(client: Client) -> None:
    assert client.clocks().clocks == []


def test_the_plan_is_text(client: Client) -> None:
    assert "period 1 ms" in client.plan().text


def test_a_write_becomes_an_event_that_names_the_client(client: Client) -> None:
    before = client.events().events
    after = before[-1].serial if before else 0
    client.sdo_write(SERVO, WINDOW, 0, 5000, type="UDINT")
    (event,) = client.events(after).events
    assert event.kind == "RemoteWrite"
    assert event.position == SERVO
    assert event.details["pid"] == os.getpid()
    assert "value=5000" in event.message


# Errors


def test_a_refused_object_raises_the_error_of_the_device(client: Client) -> None:
    with pytest.raises(SdoAbort) as caught:
        client.sdo_read(SERVO, 0x5FFF)
    assert (caught.value.position, caught.value.index) == (SERVO, 0x5FFF)
    assert caught.value.code == 0x06020000


@pytest.mark.parametrize(
    ("index", "value"), [(0x6040, 0), (0x6060, 8), (0x607A, 1), (0x1C12, 0), (0x1600, 0)]
)
def test_objects_of_an_enabled_axis_are_not_written(client: Client, index: int, value: int) -> None:
    with pytest.raises(LoopError, match="is enabled"):
        client.sdo_write(SERVO, index, 0, value)


def test_the_state_of_an_enabled_axis_is_not_changed(client: Client) -> None:
    with pytest.raises(LoopError, match="enabled"):
        client.set_state(SERVO, "PRE-OP", force=True)


def test_a_required_device_needs_force(client: Client) -> None:
    with pytest.raises(LoopError, match="required") as caught:
        client.set_state(0, "SAFE-OP")
    assert "force" in caught.value.hint


@pytest.mark.parametrize(
    ("method", "params", "text"),
    [
        ("devices", {"x": 1}, "unknown field"),
        ("sdo_read", {"position": 99, "index": 0x1000}, "no device 99"),
        ("sdo_read", {"position": -1, "index": 0x1000}, "no device -1"),
        ("sdo_read", {"position": 0, "index": 0x1000}, "no object dictionary"),
        ("sdo_read", {"position": 1, "index": 1 << 20}, "16 bits"),
        ("sdo_read", {"position": 1}, "index"),
        ("sdo_write", {"position": 1, "index": WINDOW, "value": "x"}, "not an integer"),
        ("registers", {"position": 1, "address": 0, "size": 5000}, "1024"),
        ("set_state", {"position": 1, "state": "FAST"}, "invalid state"),
        ("set_state", {"position": 1, "state": "BOOT"}, "BOOT"),
        ("objects", {"position": 1, "count": 0}, "count"),
        ("set_parameters", {"law": "x", "values": {}}, "does not run"),
        ("virtual_cable", {"position": 1, "port": 3, "connected": False}, "no cable"),
        ("virtual_power", {"position": 9, "on": False}, "no device 9"),
    ],
)
def test_mistakes_of_the_caller_are_value_errors(
    client: Client, method: str, params: dict[str, object], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        client.call(method, **params)


def test_an_unknown_method_is_not_sent(client: Client) -> None:
    with pytest.raises(ValueError, match="unknown method"):
        client.call("format_disk")


def test_a_share_that_does_not_exist() -> None:
    with pytest.raises(ShareError, match="no program serves"):
        connect("does-not-exist")


# Other programs


def test_a_loop_that_is_not_iterated_answers_what_needs_no_device() -> None:
    with program(background=False) as own, connect(own.name) as client:
        assert not client.hello().background
        with pytest.raises(ResponseTimeout, match="may not be iterated"):
            client.call("sdo_read", timeout=0.1, position=SERVO, index=WINDOW)


def test_a_loop_answers_while_the_program_iterates_it() -> None:
    with program(background=False) as own, connect(own.name) as client:
        results: list[object] = []
        thread = threading.Thread(target=lambda: results.append(client.devices()))
        thread.start()
        for _ in own.loop:
            time.sleep(0.0001)  # lets the other threads of this process run
            if not thread.is_alive():
                break
        assert len(results) == 1


def test_requests_end_with_the_loop() -> None:
    with program() as own:
        client = connect(own.name)
        assert client.hello().share == own.name
    with client, pytest.raises(ShareError, match="closed the connection"):
        client.hello()
    with pytest.raises(ShareError):
        connect(own.name)


def test_an_optional_device_leaves_and_returns() -> None:
    with program(required=False) as own, connect(own.name) as client:
        with own.loop.update():
            own.arm.disable()
        wait_until(lambda: not own.arm.enabled.any())
        assert client.set_state(SERVO, "PRE-OP").state == "PRE-OP"
        assert client.set_state(SERVO, "OP").state == "OP"
        assert client.devices()[SERVO].optional


def test_a_move_in_the_background() -> None:
    with program() as own, connect(own.name) as client:
        names = list(own.arm.names)
        client.move(names, [0.05])
        wait_until(lambda: abs(own.arm.actual.position[0] - 0.05) < 1e-3)
        with pytest.raises(ValueError, match="axes elbow"):
            client.move(["elbow"], [0.0])
        client.home(names)


def test_a_move_needs_the_background() -> None:
    with (
        program(background=False) as own,
        connect(own.name) as client,
        pytest.raises(LoopError, match="iterates its loop itself"),
    ):
        client.move(list(own.arm.names), [0.1])


def test_a_move_needs_permission() -> None:
    with program(jog=False) as own, connect(own.name) as client:
        for request in (client.home, lambda names: client.move(names, [0.1])):
            with pytest.raises(LoopError, match="does not allow motions"):
                request(list(own.arm.names))
        assert own.arm.actual.position[0] == pytest.approx(0.0, abs=1e-6)


def test_a_move_does_not_begin_after_the_deadline_of_its_request() -> None:
    with program() as own, connect(own.name) as client:
        with own.loop.update(), pytest.raises(ResponseTimeout):
            client.call("move", timeout=0.1, axes=list(own.arm.names), positions=[0.1])
        wait_until(lambda: not any(t.name == "catenary remote call" for t in threading.enumerate()))
        with own.loop.update():
            pass
        assert own.arm.target.position[0] == pytest.approx(0.0, abs=1e-6)
        client.move(own.arm.names, [0.01])  # only this one moves
        wait_until(lambda: abs(own.arm.actual.position[0] - 0.01) < 1e-3)


def test_parameters_of_a_law_are_set_together() -> None:
    @cat.law
    def keep(target, parameters):  # type: ignore[no-untyped-def]
        target.position[0] = parameters[0] + parameters[1]

    pytest.importorskip("numba")
    with program() as own, connect(own.name) as client:
        assert client.laws() == []
        run = own.loop.start(keep, parameters=[0.0, 0.0])
        (found,) = client.laws()
        assert (found.name, found.running, list(found.parameters)) == ("keep", True, ["0", "1"])
        client.set_parameters("keep", {"1": 0.001})
        assert run.parameters.tolist() == [0.0, 0.001]
        with pytest.raises(ValueError, match="no parameter '2'"):
            client.set_parameters("keep", {"2": 1.0})


def test_named_parameters_of_a_law_keep_their_limits() -> None:
    @cat.law(parameters=[cat.Parameter("offset", -0.01, 0.01, "rad"), "gain"])
    def keep(target, parameters):  # type: ignore[no-untyped-def]
        target.position[0] = parameters[0] * parameters[1]

    pytest.importorskip("numba")
    with program() as own, connect(own.name) as client:
        with pytest.raises(ValueError, match="1 given, but law keep has 2: offset, gain"):
            own.loop.start(keep, parameters=[0.0])
        run = own.loop.start(keep, parameters=[0.0, 1.0])
        offset, gain = client.laws()[0].parameters.values()
        assert (offset.minimum, offset.maximum, offset.unit) == (-0.01, 0.01, "rad")
        assert (gain.minimum, gain.maximum, gain.unit) == (None, None, "")
        with pytest.raises(
            ValueError, match=r"'offset': 0\.5 is outside of its range -0\.01 to 0\.01"
        ):
            client.set_parameters("keep", {"gain": 2.0, "offset": 0.5})
        assert run.parameters.tolist() == [0.0, 1.0]
        client.set_parameters("keep", {"gain": 2.0, "offset": 0.001})
        assert run.parameters.tolist() == [0.001, 2.0]


def test_a_virtual_cable_is_pulled_and_plugged() -> None:
    with program(required=False) as own, connect(own.name) as client:
        with own.loop.update():
            own.arm.disable()
        client.virtual_cable(SERVO, 1, False)
        wait_until(lambda: client.devices()[2].lost)
        client.virtual_cable(SERVO, 1, True)
        wait_until(lambda: client.devices()[2].state == "OP")


def wait_until(condition, timeout: float = 20.0) -> None:  # type: ignore[no-untyped-def]
    """Wait for a condition that a background thread brings about."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)
