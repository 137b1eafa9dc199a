"""Commands of an ESI in a plan: order, replacement, and commands that are omitted."""

from __future__ import annotations

from dataclasses import replace

from catenary import types
from catenary.model.device import DeviceDescription
from catenary.model.esi_settings import InitCommand, Timeouts, WatchdogValues
from catenary.plan.options import PlanOptions
from catenary.plan.planner import Plan, make_plan
from catenary.plan.request import DeviceRequest, ObjectReference
from catenary.plan.start_up_object import StartUp
from catenary.procedure.al_state import TIMEOUTS, state_timeout
from catenary.procedure.station import station_of
from catenary.wire.al import AlState
from tests.plan.devices import Asking, servo

FILTER = InitCommand(("PS",), 0x2010, 0, b"\x05\x00", source="drive.xml:52", comment="filter")


def plan_of(*commands: InitCommand, request: DeviceRequest | None = None) -> Plan:
    device = replace(servo(0), init_commands=commands)
    return make_plan([device], [Asking({0: request or DeviceRequest()})])


def test_ip_precedes_ps_and_so_follows_in_safe_op() -> None:
    late = replace(FILTER, index=0x2011, transitions=("SO",))
    first = replace(FILTER, index=0x2012, transitions=("IP",))
    down = replace(FILTER, index=0x2013, transitions=("SP", "OS"))
    commands = plan_of(late, FILTER, first, down).devices[0].commands
    assert [each.index for each in commands.in_pre_op] == [0x2012, 0x2010]
    assert [each.index for each in commands.in_safe_op] == [0x2011]
    assert commands.omitted == ()


def test_a_command_of_both_steps_in_pre_op_is_written_once() -> None:
    both = replace(FILTER, transitions=("IP", "PS"))
    assert len(plan_of(both).devices[0].downloads) == 1


def test_a_repeated_command_is_written_again() -> None:
    """All commands of a file without line breaks have the same source."""
    commands = plan_of(FILTER, replace(FILTER, data=b"\x06\x00"), FILTER).devices[0].commands
    assert [each.data[0] for each in commands.in_pre_op] == [5, 6, 5]


def test_your_object_replaces_a_command_that_is_not_fixed() -> None:
    request = DeviceRequest(objects=(StartUp(0x2010, 0, 7, type=types.UINT),))
    free = plan_of(FILTER, request=request).devices[0]
    assert [each.data for each in free.downloads] == [b"\x07\x00"]
    assert free.commands.omitted == ("0x2010:00: your start-up object replaces it (drive.xml:52)",)
    fixed = plan_of(replace(FILTER, fixed=True), request=request).devices[0]
    assert [each.data for each in fixed.downloads] == [b"\x05\x00", b"\x07\x00"]


def test_a_fixed_command_does_not_undo_your_object_in_safe_op() -> None:
    request = DeviceRequest(objects=(StartUp(0x2010, 0, 7, type=types.UINT),))
    fixed = replace(FILTER, fixed=True, transitions=("PS", "SO"))
    device = plan_of(fixed, request=request).devices[0]
    assert [each.data for each in device.downloads] == [b"\x05\x00", b"\x07\x00"]
    assert device.commands.in_safe_op == ()
    assert device.commands.omitted == (
        "0x2010:00: in SAFE-OP, your start-up object counts more (drive.xml:52)",
    )


def test_objects_of_catenary_the_mapping_and_outputs_count_more() -> None:
    mode = replace(FILTER, index=0x6060, data=b"\x08")
    written = DeviceRequest(start_up=((0x6502, 0, b"\x09"),))
    own = replace(FILTER, index=0x6502)
    mapping = replace(FILTER, index=0x1C12)
    device = plan_of(mode, own, mapping, request=written).devices[0]
    assert [line.split(": ")[1].split(" (")[0] for line in device.commands.omitted] == [
        "the process data writes this output in each cycle; set it to 08 there",
        "Catenary writes this object",
        "the plan writes the mapping",
    ]
    assert [each.index for each in device.downloads] == [0x6502]


def test_the_plan_shows_file_and_line_of_a_command() -> None:
    text = str(plan_of(FILTER))
    assert "ESI             0x2010:00  (not read) → 05 00  drive.xml:52 filter" in text


def test_a_device_without_coe_has_no_commands() -> None:
    device = replace(servo(0, coe=False), init_commands=(FILTER,))
    assert make_plan([device]).devices[0].commands.written == ()


# -- watchdog and timeouts -------------------------------------------------------------------------


def watched(values: WatchdogValues, *outputs: ObjectReference, seconds: float | None = None) -> str:
    device = replace(servo(0), watchdog=values, esi="drive.xml:10")
    request = Asking({0: DeviceRequest(outputs=outputs)})
    plan = make_plan([device], [request], PlanOptions(watchdog=seconds)).devices[0]
    return f"{plan.watchdog_ns / 1e6:g} ms {plan.watchdog_source}".strip()


def test_the_watchdog_of_the_esi_replaces_the_default() -> None:
    assert watched(WatchdogValues(None, None, 500)) == "50 ms ESI drive.xml:10"
    assert watched(WatchdogValues(4998, None, 500)) == "100 ms ESI drive.xml:10"


def test_the_application_and_cst_count_more_than_the_esi() -> None:
    values = WatchdogValues(None, None, 500)
    assert watched(values, seconds=0.02) == "20 ms"
    assert watched(values, ObjectReference(0x6071, 0, 16)) == "10 ms"


def test_an_esi_neither_disables_the_watchdog_nor_makes_it_too_short() -> None:
    assert watched(WatchdogValues(None, None, 0)) == "100 ms"
    assert watched(WatchdogValues(None, None, 20)) == "100 ms"  # 2 ms, two periods


def timed(device: DeviceDescription, state: AlState) -> float:
    return state_timeout(station_of(device), state)


def test_a_longer_timeout_of_the_esi_replaces_the_default() -> None:
    device = replace(servo(0), timeouts=Timeouts(pre_op=20.0, safe_op_and_op=1.0))
    assert timed(device, AlState.PRE_OP) == 20.0
    assert timed(device, AlState.OP) == TIMEOUTS[AlState.OP]
    assert timed(servo(0), AlState.PRE_OP) == TIMEOUTS[AlState.PRE_OP]
