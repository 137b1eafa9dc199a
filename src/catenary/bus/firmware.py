"""Firmware update of one device: identity check, BOOT, write, restart and verification.

A failure has a defined end. The device is brought to INIT, which starts its firmware or its boot
loader, and then to PRE-OP. `FirmwareResult.end` reports what runs.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from catenary.bus.firmware_result import End, FirmwareOptions, FirmwareResult, Step
from catenary.bus.firmware_version import Reported, read_reported, same_device
from catenary.bus.foe import ProgressReport
from catenary.bus.main_device import MainDevice
from catenary.errors import (
    CatenaryError,
    ConfigurationError,
    FirmwareError,
    FoeError,
    IdentityError,
    ResponseTimeout,
    StateError,
)
from catenary.procedure.al_state import read_state, request_state
from catenary.procedure.exchange import Procedure, after
from catenary.wire.al import AlState

NO_VALID_FIRMWARE = 0x0014  # AL status code
RECOVERY_TIMEOUT = 10.0  # [s] until it returns after a failure
RETRY_PAUSE = 0.5  # [s] between two scans while the device restarts


def require_idle(main: MainDevice) -> None:
    """Check that no device of the segment is in OP, in which an axis can be enabled.

    Raises:
        ConfigurationError: A device is in OP.
    """
    for sub in main.passive_scan(names=False):
        if sub.read_state().state is AlState.OP:
            raise ConfigurationError(
                f"{sub.station} is in OP: an axis may be enabled. The update resets all devices",
                hint="stop its program and bring the devices to PRE-OP (catenary state TARGET "
                "PREOP), or use --force",
            )


class FirmwareUpdate:
    """One update. This object owns the progress through the steps."""

    def __init__(
        self,
        main: MainDevice,
        position: int,
        data: bytes,
        options: FirmwareOptions,
        *,
        progress: ProgressReport | None = None,
        on_step: Callable[[Step], object] = lambda _: None,
    ) -> None:
        """Initialise the update.

        Args:
            main: The MainDevice, after a scan. No loop may run.
            position: Position of the device.
            data: Contents of the firmware file.
            options: Options of the update.
            progress: Function that receives the number of written bytes, and of all bytes.
            on_step: Function that is called at the start of each step.
        """
        self._main = main
        self._position = position
        self._count = len(main.subs)
        self._sub = main.subs[position]
        self._first = self._sub.identity
        self._data = data
        self._options = options
        self._progress = progress
        self._on_step = on_step
        self._step = Step.CHECK
        self._before: Reported | None = None
        self._seconds = 0.0
        self._notes: list[str] = []

    def run(self) -> FirmwareResult:
        """Update the firmware. An error is part of the result."""
        failure: CatenaryError
        try:
            return self._result(self._update(), None)
        except CatenaryError as error:
            failure = error
        except KeyboardInterrupt:
            failure = FirmwareError(
                f"{self._sub.station}: the update was interrupted (Ctrl+C) during the {self._step}"
            )
        return self._result(self._end_after_failure(), failure)

    def _update(self) -> End:
        steps = {
            Step.CHECK: self._check,
            Step.BOOT: self._enter_boot,
            Step.WRITE: self._write,
            Step.READ_BACK: self._read_back,
            Step.RESTART: self._restart,
        }
        for step, run in steps.items():
            self._begin(step)
            run()
        self._begin(Step.VERIFY)
        return End(AlState.PRE_OP, self._verified())

    def _begin(self, step: Step) -> None:
        self._step = step
        self._on_step(step)

    def _result(self, end: End, error: CatenaryError | None) -> FirmwareResult:
        return FirmwareResult(
            self._before, end, self._step, error, self._seconds, tuple(self._notes)
        )

    # -- steps ---------------------------------------------------------------------------------

    def _check(self) -> None:
        sub, options = self._sub, self._options
        self._before = read_reported(sub)
        found = self._before.identity
        for field, expected in (("vendor", options.vendor), ("product", options.product)):
            actual = getattr(found, field)
            if expected is not None and actual != expected:
                raise IdentityError(
                    f"{sub.station} has {field} 0x{actual:08X}; expected 0x{expected:08X}. Nothing "
                    "was written",
                    position=self._position,
                    expected=expected,
                    found=actual,
                    hint="check the position: `catenary scan` lists the devices",
                )

    def _enter_boot(self) -> None:
        self._sub.request_state(AlState.INIT)  # also restarts the mailbox of a device in BOOT
        self._sub.request_state(AlState.BOOT)

    def _write(self) -> None:
        options, start = self._options, self._main.link.now()
        try:
            self._sub.foe.write(
                options.name,
                self._data,
                password=options.password,
                progress=self._progress,
                timeout=options.timeout,
                busy_timeout=options.busy_timeout,
            )
        except ValueError as error:  # such as a name that does not fit into the bootstrap mailbox
            raise ConfigurationError(str(error), hint="use --name with a shorter name") from error
        self._seconds = (self._main.link.now() - start) * 1e-9

    def _read_back(self) -> None:
        options = self._options
        if not options.read_back:
            return
        try:
            found = self._sub.foe.read(
                options.name,
                password=options.password,
                max_size=len(self._data) + 1,
                timeout=options.timeout,
                busy_timeout=options.busy_timeout,
            )
        except FoeError as error:
            self._notes.append(f"the file cannot be read back: {error.message}")
            return
        if found != self._data:
            raise FirmwareError(
                f"{self._sub.station}: the file that was read back differs from the written one: "
                f"{len(found)} bytes instead of {len(self._data)}, or other contents",
                hint="repeat the update; if it fails again, the memory of the device is defective, "
                "or the device converts the file: leave out --read-back",
            )

    def _restart(self) -> None:
        with suppress(CatenaryError):  # a device may leave the segment before it answers
            self._sub.request_state(AlState.INIT)
        self._await_return(self._options.restart_timeout)

    def _verified(self) -> Reported:
        now = self._read_after_restart()
        sub, before, expected = self._sub, self._before, self._options.version
        if before is not None and not same_device(before.identity, now.identity):
            raise IdentityError(
                f"{sub.station} reports another identity after the update: {now.identity}; before: "
                f"{before.identity}",
                position=self._position,
                expected=before.identity,
                found=now.identity,
                hint="the file may belong to another product",
            )
        if expected is not None and now.version != expected:
            raise FirmwareError(
                f"{sub.station} reports {now} after the update; expected version {expected}",
                hint="check that the file contains this version",
            )
        if before is not None and now == before:
            self._notes.append("identity and version are the same as before the update")
        return now

    def _read_after_restart(self) -> Reported:
        """Read identity and version. If another version is expected, wait for a late restart."""
        end_ns = self._main.link.now() + round(self._options.restart_timeout * 1e9)
        while True:
            now = read_reported(self._sub)
            pending = now.version is None or (self._before is not None and now == self._before)
            expected = self._options.version not in (None, now.version)
            if not (expected and pending) or self._main.link.now() >= end_ns:
                return now
            self._main.converse(_pause())
            self._await_return(self._options.restart_timeout)

    # -- restart and failure -------------------------------------------------------------------

    def _await_return(self, timeout: float) -> None:
        """Scan until the device is in PRE-OP.

        Raises:
            CatenaryError: It is not in PRE-OP within `timeout` [s], or has no valid firmware.
        """
        end_ns = self._main.link.now() + round(timeout * 1e9)
        while True:
            error = self._scan_error()
            if error is None:
                return
            invalid = isinstance(error, StateError) and error.code == NO_VALID_FIRMWARE
            if invalid or self._main.link.now() >= end_ns:
                raise error
            self._main.converse(_pause())

    def _scan_error(self) -> CatenaryError | None:
        """Scan the segment. Return the reason why the device is not in PRE-OP, if there is one."""
        try:
            subs = self._main.scan(strict=False)
        except CatenaryError as error:
            return error
        if len(subs) != self._count:
            return ResponseTimeout(
                f"device {self._position} has not returned: the segment has {len(subs)} devices "
                f"instead of {self._count}",
                hint="check its power and its cables",
            )
        found = subs[self._position]
        if same_device(self._first, found.identity):
            self._sub = found
            return found.error
        return IdentityError(
            f"device {self._position} is now {found.identity}; before: {self._first}",
            position=self._position,
            expected=self._first,
            found=found.identity,
            hint="the file may belong to another product, or the cables were changed",
        )

    def _end_after_failure(self) -> End:
        """Bring the device out of BOOT, and find out what it runs."""
        if self._step is Step.CHECK:
            state = self._present_state()
            return End(state, self._before, "nothing was changed: correct the cause and try again")
        with suppress(CatenaryError):
            self._main.converse(request_state(self._sub.station, AlState.INIT))
        try:
            self._await_return(RECOVERY_TIMEOUT)
        except StateError as error:
            next_step = f"it refuses PRE-OP ({error.message}): power-cycle it and repeat the update"
            if error.code == NO_VALID_FIRMWARE:
                next_step = "only its boot loader runs: repeat the update with a valid file"
            return End(self._present_state(), None, next_step)
        except IdentityError as error:
            next_step = f"{error.message}: check that the file is for this product"
            return End(self._present_state(), None, next_step)
        except CatenaryError:
            return End(
                None,
                None,
                "check its power and its cables, then repeat the update: after an incomplete "
                "update, a device starts its boot loader",
            )
        now = read_reported(self._sub)
        return End(AlState.PRE_OP, now, f"it runs {now}: correct the cause and repeat the update")

    def _present_state(self) -> AlState | None:
        try:
            return self._main.converse(read_state(self._sub.station)).state
        except CatenaryError:
            return None


def _pause() -> Procedure[None]:
    yield after(RETRY_PAUSE)
