"""Reservation: a kernel master that is reserved for this process."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Self

from catenary.errors import CatenaryError, LinkError, SegmentError
from catenary.igh import abi
from catenary.igh._ecrt import KernelTime
from catenary.igh.failures import refused, sdo_error
from catenary.igh.kernel_calls import BlockingCalls
from catenary.igh.library import Library
from catenary.link import forget_in_child
from catenary.model.device import Identity
from catenary.wire.al import AlState

SCAN_TIMEOUT = 30.0  # [s]: some devices answer their first SDO after seconds
EMPTY_TIMEOUT = 3.0  # [s]: a link that has just come up finds its devices within a second
PREOP_TIMEOUT = 15.0  # [s] without a change, from INIT; the master itself waits 10 s
LEAVE_OP_TIMEOUT = 2.0  # [s] without a change, if the devices were in OP
SETTLE_TIMEOUT = 60.0  # [s] for all devices: the master handles one after the other
POLL_INTERVAL = 0.010  # [s] between two checks
UPLOAD_LIMIT = 1 << 16  # largest object [bytes]


class Reservation:
    """Kernel master that is reserved for this process.

    It implements `Link` with a clock only. It carries no frames: the master sends its own frames.
    """

    def __init__(self, library: Library, index: int, time: KernelTime) -> None:
        self.library = library
        self.index = index
        self.time = time
        self.handle = 0
        self.blocking_calls = BlockingCalls()
        self.reserve()
        forget_in_child(self)

    @property
    def name(self) -> str:
        return f"igh:{self.index}"

    @property
    def capsule(self) -> object:
        return self.time.capsule

    def send(self, frame: bytes) -> None:
        self.time.send(frame)

    def receive(self) -> bytes | None:
        return None

    def now(self) -> int:
        return self.time.now()

    def wait_until(self, deadline_ns: int, wake_on_frame: bool) -> bool:
        return self.time.wait_until(deadline_ns, wake_on_frame)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def reserve(self) -> None:
        """Reserve the master.

        Raises:
            LinkError: The master cannot be reserved.
        """
        ctypes.set_errno(0)
        self.handle = self.library.ecrt_request_master(self.index) or 0
        if not self.handle:
            raise refused(self.index, ctypes.get_errno(), self.library)

    def close(self) -> None:
        """Release the master. It then brings its devices to PRE-OP."""
        handle, self.handle = self.handle, 0
        if handle:
            self.blocking_calls.end()
            self.library.ecrt_release_master(handle)

    def forget(self) -> None:
        """Close the copies of the device file and the process data in a forked child.

        The kernel releases the master when all copies are closed, so the parent keeps it.
        """
        handle, self.handle = self.handle, 0
        if handle:
            self.library.ecrt_release_master(handle)

    def renew(self) -> None:
        """Release the master and reserve it again, which discards its configuration."""
        self.close()
        self.reserve()

    def ask(self, name: str, *arguments: object, what: str, hint: str = "") -> int:
        """Make a call with the master as its first argument; see `Library.ask`."""
        return self.library.ask(name, self._held(), *arguments, what=what, hint=hint)

    def _held(self) -> int:
        """Return the handle if the master is reserved.

        libethercat does not check handles, and a thread may make its call after `close`.
        """
        if not (handle := self.handle):
            raise RuntimeError("the master is no longer reserved")
        return handle

    # Devices of the master

    def device_count(self) -> int:
        """Wait for the end of the master's scan and return the number of devices.

        Raises:
            LinkError: The network interface has no link.
            SegmentError: The scan did not end in time.
        """
        begun, info = self.now(), abi.MasterInfo()
        while True:
            self.ask("ecrt_master", ctypes.byref(info), what=f"master {self.index}")
            waited = (self.now() - begun) * 1e-9
            settled = info.slave_count or not info.link_up or waited >= EMPTY_TIMEOUT
            if settled and not info.scan_busy:
                break
            if waited >= SCAN_TIMEOUT:
                raise SegmentError(
                    f"master {self.index} is still scanning after {SCAN_TIMEOUT:g} s",
                    hint="ethercat slaves shows the progress; dmesg may show the reason",
                )
            self.wait_until(self.now() + round(POLL_INTERVAL * 1e9), False)
        if not info.link_up:
            raise LinkError(
                f"master {self.index}: its network interface has no link",
                hint="connect the cable and switch the first device on; check with ethercat master",
            )
        return int(info.slave_count)

    def slave(self, position: int) -> abi.SlaveInfo:
        """Return the information of one device."""
        info = abi.SlaveInfo()
        self.ask("ecrt_master_get_slave", position, ctypes.byref(info), what=f"device {position}")
        return info

    def aliases(self) -> list[int]:
        """Return the aliases of all present devices, by position; 0 if a device has none."""
        return [self.slave(position).alias for position in range(self._present())]

    def has(self, position: int, identity: Identity) -> bool:
        """Return True if a device with this vendor and product is at a position now."""
        if position >= self._present():
            return False
        info = self.slave(position)
        return (info.vendor_id, info.product_code) == identity[:2]

    def wait_preop(self, patience: float = LEAVE_OP_TIMEOUT) -> None:
        """Wait until the master has brought its devices to PRE-OP, or states stop changing.

        Devices in INIT do not answer SDOs. After another application has released the master, its
        devices are still changing to PRE-OP. A device with Ethernet over EtherCAT may stay in OP,
        where it answers, too. Devices that are lost during the wait do not count.

        Args:
            patience: Longest time without a state change if no device is in INIT [s].
        """
        begun = changed = self.now()
        before: list[int] = []
        while self.now() - begun < SETTLE_TIMEOUT * 1e9:
            infos = [self.slave(position) for position in range(self._present())]
            states = [info.al_state & 0xF for info in infos if not info.error_flag]
            if all(state == AlState.PRE_OP for state in states):
                return
            if states != before:
                before, changed = states, self.now()
            limit = PREOP_TIMEOUT if AlState.INIT in states else patience
            if self.now() - changed >= limit * 1e9:
                return
            self.wait_until(self.now() + round(POLL_INTERVAL * 1e9), False)

    def _present(self) -> int:
        """Return the present number of devices, even during a scan."""
        info = abi.MasterInfo()
        self.ask("ecrt_master", ctypes.byref(info), what=f"master {self.index}")
        return int(info.slave_count)

    def sync_manager(self, position: int, index: int) -> abi.SyncInfo:
        """Return a SyncManager of a device, without its PDOs."""
        info = abi.SyncInfo()
        what = f"device {position}, SyncManager {index}"
        self.ask("ecrt_master_get_sync_manager", position, index, ctypes.byref(info), what=what)
        return info

    def pdo(self, position: int, index: int, rank: int) -> abi.PdoInfo:
        """Return a PDO of a SyncManager, without its entries."""
        info = abi.PdoInfo()
        what = f"device {position}, SyncManager {index}, PDO {rank}"
        self.ask("ecrt_master_get_pdo", position, index, rank, ctypes.byref(info), what=what)
        return info

    def pdo_entry(self, position: int, index: int, rank: int, place: int) -> abi.PdoEntryInfo:
        """Return an entry of a PDO."""
        info = abi.PdoEntryInfo()
        what = f"device {position}, SyncManager {index}, PDO {rank}, entry {place}"
        call = "ecrt_master_get_pdo_entry"
        self.ask(call, position, index, rank, place, ctypes.byref(info), what=what)
        return info

    # Objects. Both calls block, with the GIL released.

    def upload(self, position: int, index: int, subindex: int, limit: int = UPLOAD_LIMIT) -> bytes:
        """Read an object.

        Args:
            position: The position of the device.
            index: Index of the object.
            subindex: Subindex of the object.
            limit: Largest accepted length [bytes].

        Raises:
            SdoAbort: The device refuses the upload.
            MailboxError: The device did not answer, or the object is longer than `limit`.
        """
        buffer = ctypes.create_string_buffer(min(limit, UPLOAD_LIMIT))
        size, code = ctypes.c_uint64(), ctypes.c_uint32()
        result = self.library.ecrt_master_sdo_upload(
            *(self._held(), position, index, subindex),
            *(ctypes.addressof(buffer), len(buffer), ctypes.byref(size), ctypes.byref(code)),
        )
        if result < 0:
            raise self._refused_sdo(position, index, subindex, result, code.value)
        return buffer.raw[: size.value]

    def download(
        self, position: int, index: int, subindex: int, data: bytes, *, complete: bool = False
    ) -> None:
        """Write an object.

        Args:
            position: The position of the device.
            index: Index of the object.
            subindex: Subindex of the object.
            data: The encoded value.
            complete: True to write all subindices, from 0 on (complete access).

        Raises:
            SdoAbort: The device refuses the download.
            MailboxError: The device did not answer.
        """
        buffer = ctypes.create_string_buffer(data, len(data))
        code = ctypes.c_uint32()
        call: Callable[..., int] = self.library.ecrt_master_sdo_download
        place: tuple[int, ...] = (index, subindex)
        if complete:
            call, place = self.library.ecrt_master_sdo_download_complete, (index,)
        at = (ctypes.addressof(buffer), len(data), ctypes.byref(code))
        result = call(self._held(), position, *place, *at)
        if result < 0:
            raise self._refused_sdo(position, index, subindex, result, code.value)

    def _refused_sdo(
        self, position: int, index: int, subindex: int, result: int, code: int
    ) -> CatenaryError:
        return sdo_error(f"device {position}", position, index, subindex, result, code)
