"""Soe: access to the IDNs of one SERCOS drive, before and during a loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeVar

from catenary.bus.pending import Pending
from catenary.bus.protocol_channel import usable_channel
from catenary.bus.sdo import Conversations, MailboxOwner
from catenary.errors import MailboxError
from catenary.model.device import DeviceDescription
from catenary.model.sercos import Parameter
from catenary.model.sercos_axis import TELEGRAM_TYPE, SercosAxis
from catenary.procedure.exchange import Procedure
from catenary.procedure.sercos import (
    ALL,
    COMMAND_TIMEOUT,
    read_parameter,
    read_value,
    run_command,
    write_value,
)
from catenary.procedure.soe import ANSWER_TIMEOUT, Target, read, write
from catenary.procedure.telegrams import configure, with_lists
from catenary.wire.sercos import idn_number
from catenary.wire.sercos_values import Value
from catenary.wire.soe import DRIVES, Element

T = TypeVar("T")
ALL_IDNS = 17  # S-0-0017


class LoopOwner(Conversations, Protocol):
    """Interface to the MainDevice."""

    def require_no_loop(self) -> None: ...


class DriveOwner(MailboxOwner, Protocol):
    """Interface to the device of the drives."""

    description: DeviceDescription

    @property
    def main(self) -> LoopOwner: ...


class Soe:
    """Access to the parameters (IDNs) of a SERCOS drive (SoE).

        position = sub.soe.read("S-0-0051")  # in its unit, with decimals
        sub.soe.write("S-0-0032", 0b1011)
        sub.soe.command("S-0-0099")  # reset class 1 diagnostic
        print(sub.soe.describe("S-0-0047").unit)

    The calls wait for the answer. While a loop runs, any thread except the iterating one may call
    them. The iterating thread uses `request`, `request_write` and `request_command`, which do not
    wait. The acyclic frames of the loop then carry the messages.

    Notifications and emergencies of the drive are the events `SoeNotification` and `SoeEmergency`.
    """

    def __init__(self, sub: DriveOwner, *, unavailable: str = "") -> None:
        """Initialise the access.

        Args:
            sub: The device.
            unavailable: Reason why the master does not offer SoE; empty if it does.
        """
        self._sub = sub
        self._unavailable = unavailable

    def read(self, idn: str | int, *, drive: int = 0, timeout: float = ANSWER_TIMEOUT) -> Value:
        """Read the value of an IDN.

        Args:
            idn: IDN, such as "S-0-0051" or "P-0-0010", or its number of 16 bits.
            drive: Number of the drive in the device, 0 to 7.
            timeout: Longest time until the device answers a message [s].

        Returns:
            An integer; a float, if the IDN has decimals; a text; or a list. The notation stands for
            an IDN.

        Raises:
            SoeError: The drive refuses the request.
            ResponseTimeout: The device does not answer.
            MailboxError: The device violates the protocol, or does not support SoE.
            ValueError: The IDN, the drive or the time is out of range.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        return self._sub.main.converse(read_value(self._target(idn, drive, timeout)))

    def read_bytes(
        self,
        idn: str | int,
        element: Element = Element.VALUE,
        *,
        drive: int = 0,
        timeout: float = ANSWER_TIMEOUT,
    ) -> bytes:
        """Read elements of an IDN without conversion. The arguments and errors are those of `read`.

        Args:
            idn: IDN.
            element: Element, or several elements, which follow one after the other.
            drive: Number of the drive.
            timeout: Longest time until the device answers a message [s].
        """
        return self._sub.main.converse(read(self._target(idn, drive, timeout), element))

    def write(
        self, idn: str | int, value: Value, *, drive: int = 0, timeout: float = ANSWER_TIMEOUT
    ) -> None:
        """Write the value of an IDN. The drive reports its attribute first.

        Args:
            idn: IDN, such as "S-0-0032".
            value: Value, in the form that `read` returns.
            drive: Number of the drive in the device, 0 to 7.
            timeout: Longest time until the device answers a message [s].

        Raises:
            SoeError: The drive refuses the value.
            ResponseTimeout: The device does not answer.
            MailboxError: The device violates the protocol, or does not support SoE.
            ValueError: The value does not fit, or an argument is out of range.
            TypeError: The value has the wrong type.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        self._sub.main.converse(write_value(self._target(idn, drive, timeout), value))

    def write_bytes(
        self, idn: str | int, data: bytes, *, drive: int = 0, timeout: float = ANSWER_TIMEOUT
    ) -> None:
        """Write the value of an IDN without conversion. The arguments and errors are as in `write`.

        Args:
            idn: IDN.
            data: Bytes of the value. A list begins with its length and maximum length.
            drive: Number of the drive.
            timeout: Longest time until the device answers a message [s].
        """
        self._sub.main.converse(write(self._target(idn, drive, timeout), bytes(data)))

    def describe(
        self, idn: str | int, *, drive: int = 0, timeout: float = ANSWER_TIMEOUT
    ) -> Parameter:
        """Read all elements of an IDN: name, attribute, unit, limits, value and default value.

        The arguments and errors are those of `read`.
        """
        return self._sub.main.converse(read_parameter(self._target(idn, drive, timeout), ALL))

    def list(self, *, drive: int = 0, timeout: float = ANSWER_TIMEOUT) -> list[str]:
        """Read the IDNs of a drive (S-0-0017). The arguments and errors are those of `read`."""
        found = self.read(ALL_IDNS, drive=drive, timeout=timeout)
        if not isinstance(found, list):
            raise MailboxError(
                f"{self._sub.station}: S-0-0017 is not a list", hint="its firmware is at fault"
            )
        return [str(each) for each in found]

    def command(self, idn: str | int, *, drive: int = 0, timeout: float = COMMAND_TIMEOUT) -> None:
        """Run a procedure command: start it, wait for its end, and clear it.

        Args:
            idn: IDN of the command, such as "S-0-0099".
            drive: Number of the drive in the device, 0 to 7.
            timeout: Longest time until the command ends [s]. Then it is cancelled.

        Raises:
            SoeError: The drive refuses the command, or the command fails.
            ResponseTimeout: The command does not end, or the device does not answer.
            MailboxError: The device violates the protocol, or does not support SoE.
            ValueError: The IDN, the drive or the time is out of range.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        self._sub.main.converse(self._command(idn, drive, timeout))

    def configure_telegrams(
        self,
        *,
        mdt: Sequence[str | int] | None = None,
        at: Sequence[str | int] | None = None,
        drive: int = 0,
    ) -> None:
        """Choose the process data of a drive (S-0-0015, S-0-0024, S-0-0016) in PRE-OP.

        `ProcessData(sub)` then has the IDNs as names. S-0-0134 and S-0-0135 are always included.

        Args:
            mdt: IDNs of the outputs, such as ["S-0-0047"]; None: unchanged.
            at: IDNs of the inputs, such as ["S-0-0051", "S-0-0040"]; None: unchanged.
            drive: Number of the drive in the device, 0 to 7.

        Raises:
            SoeError: The drive refuses a list. S-0-0188 and S-0-0187 contain the permitted IDNs.
            ResponseTimeout: The device does not answer.
            MailboxError: The device violates the protocol, or does not support SoE.
            ValueError: An IDN or the drive is out of range.
            RuntimeError: A loop runs.
        """
        self._sub.main.require_no_loop()
        target = self._target(TELEGRAM_TYPE, drive)
        numbers = [
            None if idns is None else [idn_number(each) for each in idns] for idns in (mdt, at)
        ]
        self._sub.description = self._sub.main.converse(
            configure(target.channel, self._sub.description, drive, *numbers)
        )

    def planned_telegrams(
        self, wanted: Mapping[int, tuple[Sequence[int], Sequence[int]]]
    ) -> tuple[SercosAxis, ...]:
        """Return the drives of the device as they are with other telegrams. Write nothing.

        Args:
            wanted: IDNs of MDT and AT, without the first words, by the number of the drive. Other
                drives keep theirs.

        Raises:
            SoeError: A drive does not have an IDN.
            ResponseTimeout: The device does not answer.
            MailboxError: The device violates the protocol, or does not support SoE.
        """
        channel = self._target(TELEGRAM_TYPE, 0).channel
        axes = self._sub.description.sercos_axes
        return tuple(self._sub.main.converse(with_lists(channel, axes, wanted)))

    def request(self, idn: str | int, *, drive: int = 0) -> Pending[Value]:
        """Read while a loop runs, without waiting: poll `done`, then call `result()`.

        `result()` raises the error, if any. The arguments are those of `read`. Without a loop, the
        call waits for the answer.
        """
        return self._sub.main.request(read_value(self._target(idn, drive)))

    def request_write(self, idn: str | int, value: Value, *, drive: int = 0) -> Pending[None]:
        """Write while a loop runs, without waiting, as `request`.

        The arguments are those of `write`.
        """
        return self._sub.main.request(write_value(self._target(idn, drive), value))

    def request_command(
        self, idn: str | int, *, drive: int = 0, timeout: float = COMMAND_TIMEOUT
    ) -> Pending[None]:
        """Run a procedure command while a loop runs, without waiting, as `request`.

        The arguments are those of `command`.
        """
        return self._sub.main.request(self._command(idn, drive, timeout))

    def _command(self, idn: str | int, drive: int, timeout: float) -> Procedure[None]:
        _check(timeout)
        return run_command(self._target(idn, drive, min(timeout, ANSWER_TIMEOUT)), timeout)

    def _target(self, idn: str | int, drive: int, timeout: float = ANSWER_TIMEOUT) -> Target:
        """Return the IDN of the device. Raises the errors of the arguments and of the device."""
        number = idn_number(idn)
        if drive not in DRIVES:
            raise ValueError(f"drive must be 0 to 7, not {drive}")
        _check(timeout)
        station = self._sub.station
        in_boot = MailboxError(
            f"{station} is in BOOT, where it has no SoE", hint="bring it to PRE-OP"
        )
        without = MailboxError(
            f"{station} has no mailbox: cannot access its IDNs", hint="only SERCOS drives have IDNs"
        )
        channel = usable_channel(self._sub, self._unavailable, in_boot, without)
        return Target(channel, number, drive, timeout)


def _check(timeout: float) -> None:
    if not 0 < timeout < float("inf"):
        raise ValueError(f"timeout must be positive and finite, not {timeout} s")
