"""Objects, registers and emergencies of devices on a kernel master."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

import catenary as cat
from catenary.bus.event_types import SynchronisationFault
from catenary.errors import ConfigurationError, MailboxError, SdoAbort
from catenary.igh import Master, SubDevice
from catenary.types import UDINT, UINT
from tests.igh.double import Double
from tests.igh.loops import kernel_of
from tests.loop_options import grouped


def loop_of(main: cat.MainDevice, **options: object) -> cat.Loop:
    return cat.Loop(
        cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0), **grouped(options)
    )


def test_objects_before_a_loop(main: cat.MainDevice, double: Double) -> None:
    sub = main.subs[1]
    assert sub.sdo.read(0x6076, type=UDINT) == 1000
    sub.sdo.write(0x605A, 0, 5, type=UINT)
    assert double.value(1, 0x605A, 0) == 5
    with pytest.raises(
        SdoAbort, match=r"device 1: SDO 0x2000:01 refused with 0x06020000"
    ) as caught:
        sub.sdo.read(0x2000, 1)
    assert (caught.value.position, caught.value.code) == (1, 0x06020000)


def test_request_objects_read_objects_in_op(main: cat.MainDevice, double: Double) -> None:
    sub = main.subs[0]
    with loop_of(main) as loop:
        next(loop)
        double.forget()
        answers = [sub.sdo.request(0x6076, type=UDINT), sub.sdo.request(0x1018, 1, type=UDINT)]
        written = sub.sdo.request_write(0x605A, 0, 6, type=UINT)
        for _ in range(30):
            next(loop)
        assert [answer.result() for answer in answers] == [1000, 0xAA]
        written.result()
        calls = double.calls()
        assert calls.count("sdo_request_read 0") == 2
        assert not any(call.startswith("sdo_upload") for call in calls)
    assert double.value(0, 0x605A, 0) == 6


def test_a_refused_request_has_the_reason(main: cat.MainDevice) -> None:
    with loop_of(main) as loop:
        next(loop)
        answer = main.subs[0].sdo.request(0x2000)
        for _ in range(30):
            next(loop)
        with pytest.raises(SdoAbort, match="0x06020000"):
            answer.result()
        with pytest.raises(RuntimeError, match="in the loop's thread"):
            main.subs[0].sdo.read(0x6076)


def test_registers_in_op(main: cat.MainDevice, double: Double) -> None:
    sub = main.subs[1]
    assert isinstance(sub, SubDevice)
    double.register(1, 0x0990, 0x1234)
    with loop_of(main) as loop:
        next(loop)
        read = main.request(sub.read_register(0x0990, 2))
        write = main.request(sub.write_register(0x0F80, b"\x05"))
        for _ in range(30):
            next(loop)
        assert read.result() == b"\x34\x12"
        write.result()
    assert double.register_at(1, 0x0F80) == 5
    with pytest.raises(ConfigurationError, match="ethercat reg_read -p 1 0x0990 2"):
        main.converse(sub.read_register(0x0990, 2))


def test_emergencies_are_events(main: cat.MainDevice, double: Double) -> None:
    with loop_of(main) as loop:
        next(loop)
        double.emergency(1, bytes.fromhex("10 42 09 01 02 03 04 05"))
        for _ in range(30):
            next(loop)
    [received] = [event for event in main.events if isinstance(event, cat.events.Emergency)]
    assert (received.sub, received.error_code, received.error_register) == (main.subs[1], 0x4210, 9)
    assert main.subs[1].emergencies[0].data == b"\1\2\3\4\5"


def test_unsupported_calls_are_errors_with_a_hint(main: cat.MainDevice) -> None:
    sub = main.subs[0]
    for ask, command in (
        (sub.sdo.list, "ethercat sdos -p 0"),
        (lambda: sub.sdo.describe(0x6040), "ethercat sdos -p 0"),
        (main.passive_scan, "ethercat slaves"),
        (main.diagnose, "ethercat crc"),
        (lambda: sub.sdo.read(0x1018, complete=True), "one by one"),
    ):
        with pytest.raises(ConfigurationError, match="libethercat") as caught:
            ask()
        assert command in str(caught.value)


def test_files_need_the_tool_of_the_master(main: cat.MainDevice) -> None:
    with pytest.raises(ConfigurationError, match="libethercat has no FoE: use ethercat foe_write"):
        main.subs[0].foe.read("log.txt")
    with pytest.raises(ConfigurationError, match="ethercat states"), main.subs[0].boot():
        pass


def test_a_device_without_objects(main: cat.MainDevice, double: Double) -> None:
    sub = main.subs[0]
    sub.description = type(sub.description)(
        **{
            name: getattr(sub.description, name)
            for name in sub.description.__dataclass_fields__
            if name != "mailbox"
        },
        mailbox=None,
    )
    with pytest.raises(MailboxError, match="does not support CoE"):
        sub.sdo.read(0x1018)


def test_another_thread_reads_objects_while_the_loop_runs(doubles: dict[str, Path]) -> None:
    """In real time, a blocking call waits in a separate thread."""
    double = Double(doubles["1.6.1"])
    found: list[int] = []
    with cat.MainDevice(Master(library=double.path)) as main:
        sub = main.scan()[0]
        asking = threading.Thread(target=lambda: found.append(sub.sdo.read(0x6076, type=UDINT)))
        with loop_of(main, late_limit=0, priority=None) as loop:
            for cycle in loop:
                if cycle.number == 1:
                    asking.start()
                if found:
                    break
            asking.join()
    assert found == [1000]


def test_calls_on_an_activated_master_without_cycles_are_refused(
    main: cat.MainDevice, double: Double
) -> None:
    """A call to the real master would block in the kernel forever."""
    plan = main.plan(cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0))
    main.configure(plan)
    double.forget()
    for ask in (
        lambda: main.subs[0].sdo.read(0x6076),
        lambda: main.subs[0].sdo.write(0x605A, 0, 6, type=UINT),
    ):
        with pytest.raises(ConfigurationError, match="only while cycles run"):
            ask()
    assert double.calls() == []


def test_a_request_that_is_not_served_has_a_deadline(main: cat.MainDevice, double: Double) -> None:
    """The request of a missing device stays busy in the kernel."""
    one, two = (
        cat.Drives([drive], counts_per_turn=1000, velocity_limit=100.0, required=required)
        for drive, required in zip(main.subs.drives, (True, False), strict=True)
    )
    with cat.Loop(one, two) as loop:
        next(loop)
        double.online(1, 0)
        asked = main.subs[1].sdo.request(0x6076)
        while not asked.done:
            next(loop)
        with pytest.raises(MailboxError, match="no answer within 10 s"):
            asked.result()
        double.online(1, 1)
        again = main.subs[1].sdo.request(0x6076, type=UDINT)
        while not again.done:
            next(loop)
        assert again.result() == 1000


def test_a_silent_device_does_not_delay_others(doubles: dict[str, Path]) -> None:
    """Blocking calls wait in a thread of their device, with a deadline."""
    double = Double(doubles["1.6.1"])
    with cat.MainDevice(Master(library=double.path)) as main:
        main.scan()
        kernel_of(main).reservation.blocking_calls.timeout = 0.2
        with loop_of(main, late_limit=0, priority=None) as loop:
            double.block(0)
            stuck = main.subs[0].sdo.request_write(0x605A, 0, 6, type=UINT)
            behind = main.subs[0].sdo.request_write(0x6060, 0, b"\x08")
            other = main.subs[1].sdo.request_write(0x605A, 0, 5, type=UINT)
            while not other.done:
                next(loop)
            other.result()
            while not (stuck.done and behind.done):
                next(loop)
            with pytest.raises(MailboxError, match="the kernel has not returned"):
                stuck.result()
            with pytest.raises(MailboxError, match="is still busy with SDO 0x605A:00"):
                behind.result()
            double.block(-1)
    assert double.value(1, 0x605A, 0) == 5
    assert double.reserved() == 0


def test_a_late_thread_makes_no_call(double: Double) -> None:
    """libethercat does not check handles, so those of a released master are not used."""
    reservation = Master(library=double.path).open_link()
    reservation.close()
    double.forget()
    with pytest.raises(RuntimeError, match="no longer reserved"):
        reservation.upload(0, 0x1000, 0)
    with pytest.raises(RuntimeError, match="no longer reserved"):
        reservation.download(0, 0x6060, 0, b"\x08")
    assert double.calls() == []


def test_counters_of_the_synchronisation_become_events(
    main: cat.MainDevice, double: Double
) -> None:
    with loop_of(main, diagnosis=0.02) as loop:
        for _ in range(300):
            next(loop)
        list(main.events)
        double.set(1, 0x1C32, 0x0B, 3)
        for _ in range(300):
            next(loop)
        (event,) = [e for e in main.events if isinstance(e, SynchronisationFault)]
        assert (event.sub, event.counter, event.count) == (main.subs[1], "missed", 3)


def test_a_device_without_a_diagnosis_history(main: cat.MainDevice) -> None:
    with pytest.raises(MailboxError, match="has no diagnosis history"):
        main.subs[1].diagnosis.messages()
    (outputs,) = main.subs[1].diagnosis.synchronisation()
    assert (outputs.direction, outputs.missed, outputs.exceeded) == ("outputs", 0, None)
