"""SubDevice and Sdo on the kernel master: the handles of `bus`, over libethercat."""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable
from typing import NoReturn, TypeVar

from catenary import bus
from catenary.bus import ListType
from catenary.bus.sub_device import DeviceOwner
from catenary.errors import ConfigurationError, MailboxError, RegisterError
from catenary.igh import abi
from catenary.igh.configure import REGISTER_SIZE, REQUEST_SIZE, DeviceConfiguration
from catenary.igh.kernel_access import KernelAccess
from catenary.model.device import DeviceDescription
from catenary.procedure.al_state import DeviceState
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.sdo_information import DescribedObject
from catenary.types import DataType
from catenary.wire.al import AlState
from catenary.wire.coe import Emergency
from catenary.wire.sdo_information import ObjectDescription

T = TypeVar("T")
V = TypeVar("V")

POLL_INTERVAL = 0.001  # [s] between two checks of a request
REQUEST_TIMEOUT = 5.0  # [s]
EMERGENCIES_KEPT = 32


class SubDevice(bus.SubDevice):
    """Description and state of one device of the kernel master."""

    def __init__(
        self, main: DeviceOwner, kernel: KernelAccess, description: DeviceDescription
    ) -> None:
        super().__init__(main, description, None)
        self.sdo: Sdo = Sdo(self)
        self.foe = bus.Foe(self, unavailable="libethercat has no FoE: use ethercat foe_write")
        self.aoe = bus.Aoe(self, unavailable="libethercat has no AoE: use the interface eth0")
        self.voe = bus.Voe(self, unavailable="VoE of libethercat is not used: use eth0")
        self.eoe = bus.Eoe(self, unavailable="the kernel master has its own interfaces: ip link")
        self.soe = bus.Soe(self, unavailable="SoE needs frames of Catenary: use ethercat soe_read")
        self.kernel = kernel
        self._emergencies: deque[Emergency] = deque(maxlen=EMERGENCIES_KEPT)
        self._register_busy = False  # True while the register request is in use

    @property
    def emergencies(self) -> tuple[Emergency, ...]:
        """Most recent emergencies of the device, oldest first."""
        return tuple(self._emergencies)

    def add_emergency(self, emergency: Emergency) -> None:
        """Record an emergency that the master received from the device."""
        self._emergencies.append(emergency)

    def read_state(self) -> DeviceState:
        """Return the last EtherCAT state of the device that the master has read."""
        info = self.kernel.reservation.slave(self.kernel.place_of(self.position))
        word = info.al_state | (0x10 if info.error_flag else 0)
        known = word & 0xF in tuple(AlState)
        self.state = AlState(word & 0xF) if known else None
        return DeviceState(self.state, bool(info.error_flag), 0, word)

    def _prepare_boot(self) -> None:
        """Raise ConfigurationError: the master controls the states."""
        raise ConfigurationError(
            f"{self.station}: libethercat cannot bring single devices to BOOT",
            hint="use IgH's tool: ethercat states BOOT",
        )

    def read_register(self, address: int, size: int) -> Procedure[bytes]:
        """Read registers while a loop runs. Pass the procedure to `main.request(...)`.

        Args:
            address: Address of the first byte, 16 bits.
            size: Number of bytes, 1 to 64.

        Raises:
            ValueError: The address or the number of bytes is out of range.
            RegisterError: The request failed or was not answered in time.
            ConfigurationError: The master is not activated.
            LoopError: The loop ended before the device answered.
        """
        device = self._checked(address, size)
        library = self.kernel.reservation.library
        request = device.register_request
        yield from self._exclusively()
        try:
            self.kernel.same_configuration(device)
            library.ecrt_reg_request_read(request, address, size)
            yield from self._answered(device, f"register 0x{address:04X}")
            return ctypes.string_at(library.ecrt_reg_request_data(request), size)
        finally:
            self._register_busy = False

    def write_register(self, address: int, data: bytes) -> Procedure[None]:
        """Write registers while a loop runs. Pass the procedure to `main.request(...)`.

        Args:
            address: Address of the first byte, 16 bits.
            data: 1 to 64 bytes.

        Raises:
            ValueError: The address or the number of bytes is out of range.
            RegisterError: The request failed or was not answered in time.
            ConfigurationError: The master is not activated.
            LoopError: The loop ended before the device answered.
        """
        device = self._checked(address, len(data))
        library = self.kernel.reservation.library
        request = device.register_request
        yield from self._exclusively()
        try:
            self.kernel.same_configuration(device)
            ctypes.memmove(library.ecrt_reg_request_data(request), data, len(data))
            library.ecrt_reg_request_write(request, address, len(data))
            yield from self._answered(device, f"register 0x{address:04X}")
        finally:
            self._register_busy = False

    def _checked(self, address: int, size: int) -> DeviceConfiguration:
        if not 0 <= address <= 0xFFFF or not 1 <= size <= REGISTER_SIZE:
            raise ValueError(
                f"{size} bytes at 0x{address:X}: give 1 to {REGISTER_SIZE} bytes and an address of "
                "16 bits"
            )
        device = self.kernel.configuration_of(self.position)
        if device is None or not device.register_request:
            raise ConfigurationError(
                f"{self.station}: register access needs an activated master",
                hint="access registers while a loop runs, or run ethercat reg_read "
                f"-p {self.position} 0x{address:04X} {size}",
            )
        return device

    def _exclusively(self) -> Procedure[None]:
        while self._register_busy:
            yield after(POLL_INTERVAL)
        self._register_busy = True

    def _answered(self, device: DeviceConfiguration, what: str) -> Procedure[None]:
        state = self.kernel.reservation.library.ecrt_reg_request_state
        for _ in range(round(REQUEST_TIMEOUT / POLL_INTERVAL)):
            self.kernel.same_configuration(device)
            found = state(device.register_request)
            if found == abi.REQUEST_SUCCESS:
                return
            if found == abi.REQUEST_ERROR:
                break
            yield after(POLL_INTERVAL)
        raise RegisterError(
            f"{self.station}: no answer to the request for {what}",
            hint="the master refuses requests to a device while it is in an error state",
        )


class Sdo(bus.Sdo):
    """Access to the object dictionary of one device through the kernel master.

    During operation, a request object reads objects up to 256 bytes. It takes a few cycles and no
    thread. Longer reads and all writes make a blocking call in a thread of the device, which does
    not delay the cycle or other devices. All transfers have a deadline.
    """

    def __init__(self, sub: SubDevice) -> None:
        super().__init__(sub)
        self._device = sub
        self._busy = False  # True while the request object is in use

    def list(self, kind: ListType = ListType.ALL) -> tuple[ObjectDescription, ...]:
        """Raise ConfigurationError: libethercat does not list dictionaries."""
        self._cannot("list", "sdos")

    def describe(self, index: int) -> DescribedObject:
        """Raise ConfigurationError: libethercat does not describe objects."""
        self._cannot("describe", "sdos")

    def _cannot(self, what: str, command: str) -> NoReturn:
        raise ConfigurationError(
            f"{self._device.station}: libethercat cannot {what} the objects of a device",
            hint=f"run ethercat {command} -p {self._device.position}; `read` and `write` are "
            "available here",
        )

    def _upload(
        self, index: int, subindex: int, complete: bool, limit: int, timeout: float
    ) -> Procedure[bytes]:
        """Read an object. The deadlines of libethercat apply, not `timeout`."""
        self._check(index, subindex, complete)
        if complete:
            raise ConfigurationError(
                f"{self._device.station}: libethercat has no upload with complete access",
                hint="read the subindices one by one",
            )
        return self._uploaded(index, subindex, limit)

    def _uploaded(self, index: int, subindex: int, limit: int) -> Procedure[bytes]:
        kernel, position = self._device.kernel, self._device.position
        device = kernel.configuration_of(position)
        if device is None or not device.sdo_request or not kernel.cycling:
            return (yield from self._uploaded_blocking(index, subindex, limit))
        while self._busy:
            yield after(POLL_INTERVAL)
        self._busy = True
        try:
            data = yield from self._requested(device, index, subindex, limit)
        finally:
            self._busy = False
        if data is None:  # too long or refused: the blocking call reads it or raises the error
            data = yield from self._uploaded_blocking(index, subindex, limit)
        return data

    def _uploaded_blocking(self, index: int, subindex: int, limit: int) -> Procedure[bytes]:
        kernel = self._device.kernel

        def call() -> bytes:
            place = kernel.place_of(self._device.position)
            return kernel.reservation.upload(place, index, subindex, limit)

        return (yield from self._blocking(f"SDO 0x{index:04X}:{subindex:02X}", call))

    def _blocking(self, what: str, call: Callable[[], V]) -> Procedure[V]:
        """Make a call that waits in the kernel. Use a thread while a loop runs in real time."""
        kernel, position = self._device.kernel, self._device.position
        kernel.refuse_blocking(position)
        if not kernel.cycling or kernel.reservation.time.is_virtual:
            return call()
        return (yield from kernel.reservation.blocking_calls.run(position, what, call))

    def _requested(
        self, device: DeviceConfiguration, index: int, subindex: int, limit: int
    ) -> Procedure[bytes | None]:
        """Return the data from the request object; None if it is too long or refused."""
        library, request = self._device.kernel.reservation.library, device.sdo_request
        yield from self._idle(device)  # an abandoned request may still be busy
        library.ecrt_sdo_request_index(request, index, subindex)
        library.ecrt_sdo_request_timeout(request, round(REQUEST_TIMEOUT * 1000))
        library.ecrt_sdo_request_read(request)
        yield after(POLL_INTERVAL)
        if (yield from self._idle(device)) == abi.REQUEST_SUCCESS:
            size = library.ecrt_sdo_request_data_size(request)
            if size <= min(limit, REQUEST_SIZE):
                return ctypes.string_at(library.ecrt_sdo_request_data(request), size)
        return None

    def _idle(self, device: DeviceConfiguration) -> Procedure[int]:
        """Wait until the request object is not busy and return its state.

        Raises:
            MailboxError: It stays busy, for example because the device is lost.
        """
        kernel = self._device.kernel
        state = kernel.reservation.library.ecrt_sdo_request_state
        for _ in range(round(2 * REQUEST_TIMEOUT / POLL_INTERVAL)):
            kernel.same_configuration(device)
            found = int(state(device.sdo_request))
            if found != abi.REQUEST_BUSY:
                return found
            yield after(POLL_INTERVAL)
        raise MailboxError(
            f"{self._device.station}: no answer within {2 * REQUEST_TIMEOUT:g} s: the master has "
            "not served the request",
            hint="check that the device is present: ethercat slaves; dmesg | tail",
        )

    def _download(
        self, index: int, subindex: int, value: object, type: DataType[T] | None, complete: bool
    ) -> Procedure[None]:
        self._check(index, subindex, complete)
        data = value if type is None else type.encode(value)  # type: ignore[arg-type]
        if not isinstance(data, bytes):
            raise TypeError(f"{value!r} is not bytes: give its type, as type=catenary.types.UDINT")
        if complete and subindex:
            raise ConfigurationError(
                f"{self._device.station}: libethercat starts complete access at subindex 0 only",
                hint="start the data with subindex 0, in 16 bits",
            )
        return self._downloaded(index, subindex, data, complete)

    def _downloaded(
        self, index: int, subindex: int, data: bytes, complete: bool
    ) -> Procedure[None]:
        kernel = self._device.kernel

        def call() -> None:
            place = kernel.place_of(self._device.position)
            kernel.reservation.download(place, index, subindex, data, complete=complete)

        yield after(0)
        yield from self._blocking(f"SDO 0x{index:04X}:{subindex:02X}", call)

    def _check(self, index: int, subindex: int, complete: bool) -> None:
        if not 0 <= index <= 0xFFFF or not 0 <= subindex <= 0xFF:
            raise ValueError(f"object 0x{index:X}:{subindex:X}: an index has 16 bits, a subindex 8")
        if complete and subindex > 1:
            raise ValueError(f"complete access begins with subindex 0 or 1, not {subindex}")
        if self._device.error is not None:
            raise self._device.error
        if not self._device.description.coe:
            raise MailboxError(
                f"{self._device.station} does not support CoE: object "
                f"0x{index:04X}:{subindex:02X} cannot be accessed",
                hint="couplers and simple terminals have no object dictionary",
            )
