"""Files of a device: `sub.foe` without and with a loop, in PRE-OP and in BOOT."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.bus import MainDevice, SubDevice
from catenary.errors import EepromError, FoeError, MailboxError, ResponseTimeout, StateError
from catenary.types import VISIBLE_STRING
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    DeviceFiles,
    DeviceFirmware,
    Segment,
    Servo,
    make_firmware,
)
from catenary.virtual.foe.server import FileServer
from catenary.wire.al import AlState

IMAGE = make_firmware(0x0004_0002, "2.0", size=3000)
ROOM = 128 - 12
CONTENT = bytes(k * 13 & 0xFF for k in range(20 * ROOM))


def device(**options: object) -> AnalogInputs:
    return AnalogInputs(files=DeviceFiles(bootstrap_bytes=256, **options))  # type: ignore[arg-type]


def line(*devices: AnalogInputs | Servo | Coupler) -> Segment:
    return Segment([Coupler(), *devices])


@pytest.fixture
def terminal() -> AnalogInputs:
    return device(contents={"log.txt": CONTENT}, firmware=DeviceFirmware())


@pytest.fixture
def sub(terminal: AnalogInputs) -> Iterator[SubDevice]:
    with MainDevice(line(terminal)) as main:
        yield main.scan()[1]


def test_a_file_is_read_and_written(sub: SubDevice, terminal: AnalogInputs, tmp_path: Path) -> None:
    assert sub.foe.read("log.txt") == CONTENT
    sub.foe.write("new", b"abc")
    path = tmp_path / "file.bin"
    path.write_bytes(CONTENT[:1000])
    sub.foe.write("from a file", path)
    sub.foe.write("view", memoryview(b"abcd"))
    assert terminal.store.files == {
        "log.txt": CONTENT,
        "new": b"abc",
        "from a file": CONTENT[:1000],
        "view": b"abcd",
    }


def test_progress_is_reported_in_the_calling_thread(sub: SubDevice) -> None:
    seen: list[tuple[int, int | None]] = []
    threads: set[int] = set()

    def report(done: int, total: int | None) -> None:
        seen.append((done, total))
        threads.add(threading.get_ident())

    sub.foe.write("new", CONTENT, progress=report)
    assert seen == [(k * ROOM, len(CONTENT)) for k in range(21)]
    seen.clear()
    sub.foe.read("log.txt", progress=report)
    assert seen == [(k * ROOM, None) for k in range(21)]
    assert threads == {threading.get_ident()}


def test_a_busy_device_reports_its_own_progress() -> None:
    seen: list[tuple[int, str]] = []
    with MainDevice(line(device(busy=2))) as main:
        sub = main.scan()[1]
        sub.foe.write("new", b"abc", progress=lambda done, _: seen.append((done, sub.foe.busy)))
        assert sub.foe.busy == ""
    request = [(0, ""), (0, "0/2 busy"), (0, "1/2 busy")]
    assert seen == [*request, *request, (3, "")]


def test_a_busy_device_that_does_not_state_the_total(
    sub: SubDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter([bytes.fromhex("06001e000000"), bytes.fromhex("050001800000")])
    monkeypatch.setattr(FileServer, "serve", lambda *_: [next(answers)])
    seen: list[str] = []
    with pytest.raises(FoeError):
        sub.foe.write("new", b"", progress=lambda *_: seen.append(sub.foe.busy))
    assert "30" in seen


@pytest.mark.parametrize("after_busy", ["acknowledgement", "request"])
def test_a_busy_device_sends_its_file(after_busy: str) -> None:
    busy = device(busy=3, contents={"log.txt": CONTENT}, after_busy=after_busy)
    with MainDevice(line(busy)) as main:
        assert main.scan()[1].foe.read("log.txt") == CONTENT


def test_a_transfer_after_an_interrupted_one() -> None:
    refusing = device(contents={"log.txt": CONTENT}, second_request="refused")
    with MainDevice(line(refusing)) as main:
        sub = main.scan()[1]

        def interrupt(done: int, _: int | None) -> None:
            if done:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            sub.foe.write("new", CONTENT, progress=interrupt)
        assert sub.foe.read("log.txt") == CONTENT


def test_an_error_in_the_report_ends_the_transfer(sub: SubDevice) -> None:
    def report(done: int, total: int | None) -> None:
        if done:
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        sub.foe.write("new", CONTENT, progress=report)
    assert sub.foe.read("log.txt") == CONTENT


def test_bad_arguments_are_refused(sub: SubDevice, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"pathlib\.Path"):
        sub.foe.write("new", "app.efw")  # type: ignore[arg-type]
    with pytest.raises(FileNotFoundError):
        sub.foe.write("new", tmp_path / "missing")
    with pytest.raises(ValueError, match="has 0 characters"):
        sub.foe.read("")
    with pytest.raises(ValueError, match="timeout must be positive"):
        sub.foe.read("log.txt", timeout=0)
    with pytest.raises(ValueError, match="busy_timeout must be positive"):
        sub.foe.read("log.txt", busy_timeout=float("inf"))
    with pytest.raises(MailboxError, match="larger than 100 bytes"):
        sub.foe.read("log.txt", max_size=100)


def test_a_device_without_files_or_mailbox() -> None:
    with MainDevice(line(AnalogInputs())) as main:
        coupler, terminal = main.scan()
        with pytest.raises(MailboxError, match="protocol is not supported"):
            terminal.foe.read("a")
        with pytest.raises(MailboxError, match="has no mailbox"):
            coupler.foe.read("a")
        with pytest.raises(EepromError, match="no bootstrap mailbox"), terminal.boot():
            pass
        assert terminal.read_state().state is AlState.PRE_OP


def test_boot_uses_the_bootstrap_mailbox(sub: SubDevice, terminal: AnalogInputs) -> None:
    with pytest.raises(FoeError, match="only in the state BOOT"):
        sub.foe.write("app.efw", IMAGE)
    with sub.boot() as foe:
        assert (sub.state, sub.read_state().state) == (AlState.BOOT, AlState.BOOT)
        with pytest.raises(MailboxError, match="in BOOT, which has no object dictionary"):
            sub.sdo.read(0x100A)
        foe.write("app.efw", IMAGE)
    assert sub.read_state().state is AlState.PRE_OP
    assert sub.sdo.read(0x100A, type=VISIBLE_STRING) == "2.0"
    assert sub.foe.read("log.txt") == CONTENT
    assert terminal.store.flash is not None


def test_a_device_that_restarts_after_boot_needs_another_scan() -> None:
    restarting = device(firmware=DeviceFirmware(restart="power"))
    with MainDevice(line(restarting)) as main:
        sub = main.scan()[1]
        with pytest.raises(ResponseTimeout, match="scan again"), sub.boot() as foe:
            foe.write("app.efw", IMAGE)
        main.link.wait_until(main.link.now() + 50_000_000, False)
        assert main.scan()[1].sdo.read(0x100A, type=VISIBLE_STRING) == "2.0"


def test_boot_twice(sub: SubDevice) -> None:
    sub.request_state("BOOT")
    with sub.boot() as foe:  # through INIT, which restarts the counters of the mailbox
        foe.write("app.efw", IMAGE)
    with sub.boot() as foe:
        foe.write("app.efw", IMAGE)
    assert sub.read_state().state is AlState.PRE_OP


def test_boot_requested_in_boot_keeps_the_counter_of_the_mailbox(sub: SubDevice) -> None:
    for _ in range(2):
        sub.request_state("BOOT")
        with pytest.raises(FoeError, match="not accessible in the state BOOT"):
            sub.foe.read("log.txt")  # one message
    assert sub.file_channel is not None
    assert sub.file_channel.counter == 2  # a device drops a message with the last counter


def test_in_boot_the_processor_of_the_device_owns_its_eeprom(terminal: AnalogInputs) -> None:
    segment = line(terminal)
    with MainDevice(segment) as main:
        subs = main.passive_scan()
        segment.core.poke(1, 0x0500, b"\0")
        main.request_states(subs, [1], AlState.BOOT)
        assert segment.core.peek(1, 0x0500, 1) == b"\1"


def test_a_device_that_was_left_in_boot(sub: SubDevice) -> None:
    sub.request_state("BOOT")
    [_, found] = sub.main.passive_scan()  # type: ignore[attr-defined]
    assert found.read_state().state is AlState.BOOT
    found.request_state("BOOT")
    with pytest.raises(FoeError, match="not accessible in the state BOOT"):
        found.foe.read("log.txt")


def test_an_interruption_of_the_transition_leaves_the_device_in_init(
    sub: SubDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    request_state = SubDevice.request_state

    def interrupt(device: SubDevice, state: AlState) -> object:
        outcome = request_state(device, state)
        if state is AlState.BOOT:
            raise KeyboardInterrupt
        return outcome

    monkeypatch.setattr(SubDevice, "request_state", interrupt)
    with pytest.raises(KeyboardInterrupt), sub.boot():
        pass
    assert sub.read_state().state is AlState.INIT


def test_a_refused_boot_leaves_the_device_in_init_without_an_error(
    sub: SubDevice, terminal: AnalogInputs
) -> None:
    terminal.refuse_state(3, 0x0029, times=1)
    with pytest.raises(StateError, match="0x0029"), sub.boot():
        pass
    found = sub.read_state()
    assert (found.state, found.error) == (AlState.INIT, False)


def test_an_error_in_boot_leaves_the_device_in_init(sub: SubDevice) -> None:
    with pytest.raises(FoeError, match="not accessible in the state BOOT"), sub.boot() as foe:
        foe.read("log.txt")
    assert sub.read_state().state is AlState.INIT


def test_a_passive_scan_reads_the_bootstrap_mailbox(terminal: AnalogInputs) -> None:
    with MainDevice(line(terminal)) as main:
        for names in (True, False):
            main.scan()
            main.passive_scan(names=names)
            [state] = main.request_states(
                main.passive_scan(names=names), [1], AlState.BOOT
            ).values()
            assert state == main.subs[1].read_state()
            assert main.subs[1].state is AlState.BOOT


def test_a_boot_loader_without_firmware_is_found_and_recovers(terminal: AnalogInputs) -> None:
    with MainDevice(line(terminal)) as main:
        sub = main.scan()[1]
        with pytest.raises(FoeError, match="checksum"), sub.boot() as foe:
            foe.write("app.efw", IMAGE[:-1])
        with pytest.raises(StateError, match="No valid firmware"):
            main.scan()
        sub = main.scan(strict=False)[1]
        assert isinstance(sub.error, StateError)
        with pytest.raises(StateError, match="No valid firmware"):
            sub.foe.read("log.txt")
        with sub.boot() as foe:
            foe.write("app.efw", IMAGE)
        assert main.scan()[1].sdo.read(0x100A, type=VISIBLE_STRING) == "2.0"


def test_a_transfer_while_a_loop_runs() -> None:
    servo = Servo(files=DeviceFiles(contents={"log.txt": CONTENT}))
    with cat.MainDevice(line(servo)) as main:
        sub = main.scan()[1]
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm) as loop:
            read = sub.foe.request("log.txt")
            written = sub.foe.request_write("new", CONTENT)
            for _ in loop:
                if read.done and written.done:
                    break
                with pytest.raises(RuntimeError, match="would stop the loop"):
                    sub.foe.read("log.txt")
            assert loop.timing.counters["lost"] == 0
            with pytest.raises(RuntimeError, match="a loop runs"), sub.boot():
                pass
        assert read.result() == CONTENT
        assert written.result() is None
        assert servo.store.files["new"] == CONTENT


def test_another_thread_transfers_with_progress_while_a_loop_runs() -> None:
    servo = Servo(files=DeviceFiles())
    seen: list[int] = []
    with cat.MainDevice(line(servo)) as main:
        sub = main.scan()[1]
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm) as loop:
            thread = threading.Thread(
                target=lambda: sub.foe.write(
                    "new", CONTENT, progress=lambda done, total: seen.append(done)
                )
            )
            thread.start()
            for _ in loop:
                if not thread.is_alive():
                    break
            thread.join()
    assert servo.store.files["new"] == CONTENT
    assert seen[-1] == len(CONTENT)


def test_an_error_in_the_report_ends_a_transfer_next_to_a_loop() -> None:
    servo = Servo(files=DeviceFiles(contents={"log.txt": CONTENT}))
    errors: list[BaseException] = []
    with cat.MainDevice(line(servo)) as main:
        sub = main.scan()[1]
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=100.0)

        def report(done: int, total: int | None) -> None:
            raise LookupError("enough")

        def write() -> None:
            try:
                sub.foe.write("new", CONTENT * 100, progress=report)
            except LookupError as error:
                errors.append(error)

        with cat.Loop(arm) as loop:
            thread = threading.Thread(target=write)
            thread.start()
            for _ in loop:
                if not thread.is_alive():
                    break
            thread.join()
            read = sub.foe.request("log.txt")
            for _ in loop:
                if read.done:
                    break
        assert read.result() == CONTENT
    assert [str(error) for error in errors] == ["enough"]
    assert "new" not in servo.store.files


def test_a_busy_device_is_given_up_in_time() -> None:
    with MainDevice(line(device(busy=60_000))) as main:
        sub = main.scan()[1]
        with pytest.raises(ResponseTimeout, match="has been busy for 2 s after 0 bytes"):
            sub.foe.write("new", b"abc", busy_timeout=2.0)
