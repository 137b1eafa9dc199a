"""A firmware update fails in every way: refused, wrong, interrupted, or without power half-way.
Each failure ends in time, with a specific error, and in a state that the result names.
A device that lost its firmware has its boot loader, and a second update recovers it.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.bus.firmware import FirmwareUpdate, require_idle
from catenary.bus.firmware_result import FirmwareOptions, FirmwareResult, Step
from catenary.errors import (
    ConfigurationError,
    EepromError,
    FirmwareError,
    FoeError,
    IdentityError,
    ResponseTimeout,
    StateError,
)
from catenary.link import Fault, FaultInjector
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    DeviceFiles,
    DeviceFirmware,
    Segment,
    Servo,
    make_firmware,
)
from catenary.wire.al import AlState

PRODUCT, TERMINAL = 0x0004_0002, 1
IMAGE = make_firmware(PRODUCT, "2.0", revision=9, size=20_000)
PRE_OP, INIT, OFF = 2, 1, 0


class Cell:
    """Line of a coupler, the terminal that is updated, and a servo."""

    def __init__(
        self, *, restart: str = "state", reading: str = "refused", **files: object
    ) -> None:
        firmware = DeviceFirmware(restart=restart, reading=reading)  # type: ignore[arg-type]
        self.terminal = AnalogInputs(
            serial=7,
            files=DeviceFiles(firmware=firmware, bootstrap_bytes=256, **files),  # type: ignore[arg-type]
        )
        self.segment = Segment([Coupler(), self.terminal, Servo()])
        self.faults: list[Fault] = []  # of the next update
        self.steps: list[Step] = []

    @contextmanager
    def main(self) -> Iterator[cat.MainDevice]:
        self.link = FaultInjector(self.segment, *self.faults)
        with cat.MainDevice(self.link) as main:
            main.scan(strict=False)
            yield main

    def update(
        self,
        image: bytes = IMAGE,
        *,
        during: Callable[[int], object] = lambda _: None,
        **options: object,
    ) -> FirmwareResult:
        """Update the terminal. `during` receives the number of written bytes."""
        given = FirmwareOptions(**{"name": "app.efw", **options})  # type: ignore[arg-type]
        with self.main() as main:
            result = FirmwareUpdate(
                main,
                TERMINAL,
                image,
                given,
                progress=lambda done, _: during(done),
                on_step=self.steps.append,
            ).run()
            if self.terminal.state != OFF:  # the other devices are not affected
                assert self.segment[2].state == PRE_OP
        return result

    @property
    def version(self) -> str | None:
        """Version of the firmware that the terminal runs; None: only its boot loader."""
        flash = self.terminal.store.flash
        assert flash is not None
        return None if flash.running is None else flash.running.version


def assert_old_firmware_runs(cell: Cell, result: FirmwareResult) -> None:
    assert cell.version == "1.0"
    assert result.end.state is AlState.PRE_OP
    assert result.end.reported == result.before
    assert result.end.next_step


def assert_boot_loader_recovers(cell: Cell, result: FirmwareResult) -> None:
    """Check that only the boot loader runs, and that the next update succeeds."""
    assert cell.version is None
    assert (result.end.state, result.end.reported) == (AlState.INIT, None)
    assert "only its boot loader runs: repeat the update" in result.end.next_step
    again = cell.update()
    assert (again.error, cell.version) == (None, "2.0")
    assert again.before is not None
    assert again.before.version is None


@pytest.mark.parametrize("restart", ["state", "power"])
def test_a_successful_update(restart: str) -> None:
    cell = Cell(restart=restart)
    result = cell.update(version="2.0", product=PRODUCT)
    assert result.error is None
    assert (result.step, cell.steps) == (Step.VERIFY, list(Step))
    assert cell.version == "2.0"
    assert result.before is not None
    assert result.end.reported is not None
    assert (result.before.version, result.end.reported.version) == ("1.0", "2.0")
    assert result.end.reported.identity.revision == 9 != result.before.identity.revision
    assert result.seconds > 0


def test_wrong_password() -> None:
    cell = Cell(password=0x1234)
    result = cell.update(password=0x4321)
    assert isinstance(result.error, FoeError)
    assert (result.error.code, result.step) == (0x800A, Step.WRITE)
    assert_old_firmware_runs(cell, result)
    assert cell.update(password=0x1234).error is None


def test_file_not_found() -> None:
    cell = Cell(new_files=False, bootstrap_only=("other.efw",))
    result = cell.update(name="other.efw")
    assert isinstance(result.error, FoeError)
    assert result.error.code == 0x8001
    assert_old_firmware_runs(cell, result)


def test_a_name_that_does_not_fit_into_the_bootstrap_mailbox() -> None:
    cell = Cell()
    result = cell.update(name="x" * 300)
    assert isinstance(result.error, ConfigurationError)
    assert "accepts 1 to 244" in result.error.message
    assert_old_firmware_runs(cell, result)


def test_disk_full() -> None:
    cell = Cell(size_limit=15_000)
    result = cell.update()
    assert isinstance(result.error, FoeError)
    assert result.error.code == 0x8003
    assert "refused after 14884 bytes" in result.error.message
    assert cell.version is None
    smaller = make_firmware(PRODUCT, "1.5", size=14_000)
    assert cell.update(smaller).error is None
    assert cell.version == "1.5"


def test_busy_for_ever() -> None:
    cell = Cell(busy=1 << 40)
    result = cell.update(busy_timeout=3.0)
    assert isinstance(result.error, ResponseTimeout)
    assert "has been busy for 3 s" in result.error.message
    assert_old_firmware_runs(cell, result)


@pytest.mark.parametrize(
    "image",
    [IMAGE[:-1], b"not a firmware", make_firmware(PRODUCT + 1, "2.0")],
    ids=["damaged", "another file", "another product"],
)
def test_a_file_that_the_device_refuses_at_its_end(image: bytes) -> None:
    cell = Cell()
    result = cell.update(image)
    assert isinstance(result.error, FoeError)
    assert result.step is Step.WRITE
    assert_boot_loader_recovers(cell, result)


def test_power_cut_in_the_middle_of_the_write() -> None:
    cell = Cell()

    def cut_power(done: int) -> None:
        if done > 5000 and cell.terminal.state != OFF:
            cell.terminal.power_off()
            cell.terminal.power_on()

    result = cell.update(during=cut_power)
    assert isinstance(result.error, ResponseTimeout)
    assert "no answer from station" in result.error.message
    assert_boot_loader_recovers(cell, result)


def test_device_lost_in_the_middle_of_the_write() -> None:
    cell = Cell()
    lost: list[int] = []

    def lose(done: int) -> None:
        if done > 5000 and not lost:
            lost.append(done)
            cell.terminal.power_off()

    result = cell.update(during=lose)
    assert isinstance(result.error, ResponseTimeout)
    assert (result.end.state, result.end.reported) == (None, None)
    assert "check its power and its cables, then repeat" in result.end.next_step
    cell.terminal.power_on()
    assert cell.update().error is None
    assert cell.version == "2.0"


def test_interrupted_by_the_user() -> None:
    cell = Cell()

    def interrupt(done: int) -> None:
        if done > 5000:
            raise KeyboardInterrupt

    result = cell.update(during=interrupt)
    assert isinstance(result.error, FirmwareError)
    assert "interrupted (Ctrl+C) during the write" in result.error.message
    assert_boot_loader_recovers(cell, result)


@pytest.mark.parametrize("expected", [{"product": 5}, {"vendor": 2}])
def test_wrong_identity(expected: dict[str, int]) -> None:
    cell = Cell()
    result = cell.update(**expected)
    assert isinstance(result.error, IdentityError)
    assert (result.step, cell.steps) == (Step.CHECK, [Step.CHECK])
    assert "Nothing was written" in result.error.message
    assert_old_firmware_runs(cell, result)


def test_boot_refused() -> None:
    cell = Cell()
    with cell.main():
        cell.terminal.refuse_state(3, 0x0029, times=1)
    result = cell.update()
    assert isinstance(result.error, StateError)
    assert (result.error.code, result.step) == (0x0029, Step.BOOT)
    assert_old_firmware_runs(cell, result)


def test_a_device_without_boot() -> None:
    cell = Cell()
    cell.terminal = AnalogInputs()
    cell.segment = Segment([Coupler(), cell.terminal, Servo()])
    result = cell.update()
    assert isinstance(result.error, EepromError)
    assert "does not support BOOT" in result.error.message
    assert result.end.state is AlState.PRE_OP


def test_another_version_than_expected() -> None:
    cell = Cell()
    result = cell.update(version="3.0")
    assert isinstance(result.error, FirmwareError)
    assert result.step is Step.VERIFY
    assert "reports version 2.0" in result.error.message
    assert "expected version 3.0" in result.error.message
    assert result.end.state is AlState.PRE_OP
    assert cell.version == "2.0"


def test_the_same_version_is_noted() -> None:
    cell = Cell()
    cell.update()
    result = cell.update()
    assert result.error is None
    assert result.notes == ("identity and version are the same as before the update",)


def test_a_file_that_cannot_be_read_back_is_noted() -> None:
    cell = Cell()
    result = cell.update(read_back=True)
    assert result.error is None
    assert "cannot be read back" in result.notes[0]


def test_a_file_is_read_back() -> None:
    result = Cell(reading="same").update(read_back=True)
    assert (result.error, result.notes) == (None, ())


def test_another_file_is_read_back() -> None:
    cell = Cell(reading="coded")
    result = cell.update(read_back=True)
    assert isinstance(result.error, FirmwareError)
    assert (result.step, result.end.state) == (Step.READ_BACK, AlState.PRE_OP)
    assert cell.version == "2.0"


def test_lost_frames_do_not_end_the_update() -> None:
    cell = Cell()
    cell.faults = [Fault(kind="lose", frames=range(400, 4000, 37))]
    result = cell.update()
    assert (result.error, cell.version) == (None, "2.0")
    assert cell.link.injected["lose"] > 10


def test_a_device_that_does_not_return() -> None:
    cell = Cell(restart="power")

    def stay_off(step: Step) -> None:
        if step is Step.RESTART:
            cell.terminal.reset = cell.terminal.switch_off  # type: ignore[method-assign]
            cell.terminal.application.on_restart = cell.terminal.power_off

    cell.steps = _Calls(stay_off)
    result = cell.update(restart_timeout=5.0)
    assert isinstance(result.error, ResponseTimeout)
    assert result.step is Step.RESTART
    assert "the segment has 1 devices instead of 3" in result.error.message
    assert result.end.state is None


def test_a_device_that_restarts_late() -> None:
    cell = Cell(restart="power")

    def delay(step: Step) -> None:
        if step is Step.RESTART:
            scheduler = cell.terminal._scheduler
            assert scheduler is not None
            cell.terminal.application.on_restart = lambda: scheduler.after(
                3_000_000_000, cell.terminal.reset
            )

    cell.steps = _Calls(delay)
    result = cell.update(version="2.0")
    assert (result.error, cell.version) == (None, "2.0")


def test_another_identity_after_the_restart(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = Cell()

    def replace_device(step: Step) -> None:
        if step is Step.RESTART:  # the EEPROM of a virtual device does not change
            monkeypatch.setattr("catenary.bus.firmware.same_device", lambda *_: False)

    cell.steps = _Calls(replace_device)
    result = cell.update(restart_timeout=5.0)
    assert isinstance(result.error, IdentityError)
    assert "device 1 is now vendor" in result.error.message
    assert result.end.state is AlState.PRE_OP
    assert "is now vendor" in result.end.next_step


def test_a_device_that_keeps_its_firmware() -> None:
    cell = Cell(restart="power")

    def keep(step: Step) -> None:
        if step is Step.RESTART:
            cell.terminal.application.on_restart = lambda: None

    cell.steps = _Calls(keep)
    result = cell.update(version="2.0", restart_timeout=5.0)
    assert isinstance(result.error, FirmwareError)
    assert "reports version 1.0" in result.error.message


class _Calls(list[Step]):
    """List that also passes each new element to a function."""

    def __init__(self, function: Callable[[Step], object]) -> None:
        super().__init__()
        self._function = function

    def append(self, step: Step) -> None:
        super().append(step)
        self._function(step)


def test_a_segment_in_op_is_refused() -> None:
    cell = Cell()
    with cell.main() as main:
        require_idle(main)
        main.subs[0].request_state("OP")
        with pytest.raises(ConfigurationError, match=r"device 0.*OP: an axis may be enabled"):
            require_idle(main)
