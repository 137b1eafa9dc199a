"""Location of faulty cables and devices from hand-written error counters.

The cases are those of Beckhoff's application note "ESC FAQ", §3.12.4, figure 2.
"""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from catenary.model.diagnosis import judge
from catenary.model.finding import Kind
from catenary.model.topology import Cable
from catenary.wire.error_counters import ErrorCounters, PortErrors
from tests.model.tables import END, LINE, STAR, counted, line, seen

BROKEN = PortErrors(invalid_frames=14, symbol_errors=3)
SYMBOLS = PortErrors(symbol_errors=40)
MARKED = PortErrors(forwarded=14)
LOST = PortErrors(lost_links=2)


def test_no_counts_give_no_findings() -> None:
    assert judge(seen(line(5), {})) == ()


def test_broken_frames_at_a_port_locate_its_cable() -> None:
    table = {
        2: counted(p0=BROKEN, processing_unit=14),
        3: counted(p0=MARKED, processing_unit=14),
        1: counted(p1=MARKED),
    }
    [found] = judge(seen(line(4), table))
    assert found.kind is Kind.CABLE
    assert found.cable == Cable(1, 1, 2)
    assert found.where == "the cable between device 1 (d1) port 1 and device 2 (d2) port 0"
    assert found.evidence == "14 broken frames, 3 symbol errors at device 2 (d2) port 0"


def test_broken_frames_in_the_other_direction_locate_the_same_cable() -> None:
    [found] = judge(seen(line(4), {1: counted(p1=BROKEN), 0: counted(p1=MARKED)}))
    assert found.cable == Cable(1, 1, 2)
    assert "at device 1 (d1) port 1" in found.evidence


def test_counts_at_both_ends_give_one_finding() -> None:
    [found] = judge(seen(line(4), {1: counted(p1=BROKEN), 2: counted(p0=BROKEN)}))
    assert found.cable == Cable(1, 1, 2)
    assert found.evidence.count("14 broken frames") == 2


def test_the_cable_to_the_first_device() -> None:
    [found] = judge(seen(line(3), {0: counted(p0=BROKEN)}))
    assert found.where == "the cable between the MainDevice and device 0 (d0) port 0"


def test_symbol_errors_are_reported() -> None:
    [found] = judge(seen(line(3), {1: counted(p0=SYMBOLS)}))
    assert (found.kind, found.evidence) == (Kind.CABLE, "40 symbol errors at device 1 (d1) port 0")


def test_a_saturated_counter_is_reported_as_such() -> None:
    [found] = judge(seen(line(3), {1: counted(p0=PortErrors(invalid_frames=255))}))
    assert "255 or more broken frames" in found.evidence


def test_a_branch_is_distinguished_from_the_trunk() -> None:
    # 0 ─ 1 with branches: port 3 → 2, port 1 → 3, port 2 → 4
    ports = [LINE, STAR, END, END, END]
    [found] = judge(seen(ports, {1: counted(p2=BROKEN)}))
    assert found.cable == Cable(1, 2, 4)
    [found] = judge(seen(ports, {2: counted(p0=BROKEN)}))
    assert found.cable == Cable(1, 3, 2)


def test_two_separate_cables_are_two_findings_the_worse_first() -> None:
    table = {1: counted(p0=PortErrors(1)), 4: counted(p0=BROKEN)}
    found = judge(seen(line(6), table))
    assert [each.cable for each in found] == [Cable(3, 1, 4), Cable(0, 1, 1)]


def test_noise_on_all_cables_of_a_device_locates_the_device() -> None:
    [found] = judge(seen(line(5), {2: counted(p0=BROKEN, p1=BROKEN)}))
    assert (found.kind, found.devices) == (Kind.DEVICE, (2,))
    # the same if the device is a bad sender: its neighbours count
    [found] = judge(seen(line(5), {1: counted(p1=BROKEN), 3: counted(p0=BROKEN)}))
    assert (found.kind, found.devices) == (Kind.DEVICE, (2,))


def test_noise_on_most_cables_has_a_shared_cause() -> None:
    table = {n: counted(p0=PortErrors(n + 1)) for n in range(4)}
    [found] = judge(seen(line(5), table))
    assert (found.kind, found.devices) == (Kind.EVERYWHERE, (0, 1, 2, 3))
    assert "4 of 5 cables" in found.evidence
    assert "the worst is the cable between device 2 (d2) port 1 and device 3" in found.evidence


def test_an_unplugged_cable_counts_at_both_ends() -> None:
    [found] = judge(seen(line(4), {1: counted(p1=LOST), 2: counted(p0=LOST)}))
    assert (found.kind, found.cable) == (Kind.CABLE, Cable(1, 1, 2))
    assert found.evidence.count("2 lost links") == 2


def test_a_device_that_lost_its_power_has_no_counts() -> None:
    [found] = judge(seen(line(4), {1: counted(p1=LOST), 3: counted(p0=LOST)}))
    assert (found.kind, found.devices) == (Kind.POWER, (2,))
    assert found.where == "the power of device 2 (d2)"
    assert "device 1 (d1) port 1 lost its link 2 times" in found.evidence


def test_power_loss_of_the_last_device() -> None:
    [found] = judge(seen(line(4), {2: counted(p1=PortErrors(lost_links=1))}))
    assert (found.kind, found.devices) == (Kind.POWER, (3,))
    assert "once" in found.evidence


def test_power_loss_of_a_junction_explains_all_its_cables() -> None:
    ports = [LINE, STAR, END, END, END]
    table = {0: counted(p1=LOST), **{n: counted(p0=LOST) for n in (2, 3, 4)}}
    [found] = judge(seen(ports, table))
    assert (found.kind, found.devices) == (Kind.POWER, (1,))


def test_a_restarted_device_may_have_new_counts() -> None:
    table = {1: counted(p1=LOST), 2: counted(p0=PortErrors(lost_links=1)), 3: counted(p0=LOST)}
    found = judge(seen(line(4), table, restarted=frozenset((2,))))
    assert [each.kind for each in found] == [Kind.POWER]
    found = judge(seen(line(4), table))
    assert {each.kind for each in found} == {Kind.CABLE}


def test_marked_frames_without_invalid_frames() -> None:
    [found] = judge(seen(line(5), {3: counted(p0=MARKED, processing_unit=14)}))
    assert found.kind is Kind.CABLE
    assert found.cable == Cable(1, 1, 2)
    assert "marked as broken, but no device has counted where they broke" in found.evidence


def test_frames_marked_before_the_first_device() -> None:
    [found] = judge(seen(line(3), {0: counted(p0=MARKED)}))
    assert found.kind is Kind.MAIN


def test_undamaged_alien_frames_at_the_first_device() -> None:
    table = {n: counted(processing_unit=5) for n in range(3)}
    [found] = judge(seen(line(3), table))
    assert found.kind is Kind.MAIN
    assert "no other program" in found.advice


def test_frames_corrupted_inside_a_device() -> None:
    [found] = judge(seen(line(4), {2: counted(processing_unit=5), 3: counted(processing_unit=5)}))
    assert (found.kind, found.devices) == (Kind.DEVICE, (1, 2))


def test_lost_frames_that_no_device_has_counted() -> None:
    [found] = judge(seen(line(3), {}, lost_frames=7))
    assert found.kind is Kind.MAIN
    assert "the path from device 0 (d0) back to the MainDevice" in found.where


def test_lost_frames_are_explained_by_a_cable() -> None:
    [found] = judge(seen(line(3), {1: counted(p0=BROKEN)}, lost_frames=7))
    assert found.kind is Kind.CABLE


def test_counts_at_a_port_without_a_device() -> None:
    [found] = judge(seen([LINE, LINE], {1: counted(p1=BROKEN)}))
    assert found.where == (
        "the cable between device 1 (d1) port 1 and something that does not answer"
    )


def test_the_second_end_of_a_ring() -> None:
    table = seen([LINE, LINE], {1: counted(p1=BROKEN)}, ring=True)
    [found] = judge(table)
    assert found.where == (
        "the cable between device 1 (d1) port 1 and the MainDevice's second interface"
    )


def test_errors_of_the_processor_interface() -> None:
    [found] = judge(seen(line(3), {1: counted(pdi=3)}))
    assert (found.kind, found.devices) == (Kind.DEVICE, (1,))


def test_a_silent_device_has_no_counters() -> None:
    table = seen(line(3), {1: counted(p0=BROKEN)})
    quiet = type(table)(table.topology, table.names, (*table.errors[:2], None))
    [found] = judge(quiet)
    assert found.cable == Cable(0, 1, 1)


byte = st.integers(0, 255)
port_errors = st.builds(PortErrors, byte, byte, byte, byte)
counters = st.builds(ErrorCounters, st.tuples(*[port_errors] * 4), byte, byte)


@given(
    st.lists(st.tuples(*[st.booleans()] * 4), min_size=1, max_size=8),
    st.lists(st.none() | counters, min_size=8, max_size=8),
    st.sets(st.integers(0, 7)),
    byte,
)
def test_any_counts_at_any_ports_are_accepted(ports, errors, restarted, lost) -> None:
    table = seen(list(ports), {}, restarted=frozenset(restarted), lost_frames=lost)
    found = judge(
        type(table)(table.topology, table.names, tuple(errors[: len(ports)]), table.restarted, lost)
    )
    for each in found:
        assert each.where
        assert each.evidence
        assert each.advice
        assert all(0 <= position < len(ports) for position in each.devices)


@given(st.integers(2, 12), st.data())
def test_one_noisy_cable_of_a_line_is_found(count: int, data: st.DataObject) -> None:
    """Forwarded errors at the devices after the cable do not affect the result."""
    at = data.draw(st.integers(0, count - 1))
    table = {n: counted(p0=MARKED, p1=MARKED, processing_unit=14) for n in range(at + 1, count)}
    table |= {n: counted(p1=MARKED) for n in range(at)}
    table[at] = counted(p0=BROKEN, p1=MARKED, processing_unit=14)
    [found] = judge(seen(line(count), table))
    assert found.cable is not None
    assert found.cable.lower == at
