"""Reservation: owns a kernel master while it is ours."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Self

from catenary.errors import CatenaryError, LinkError, SegmentError
from catenary.igh import abi
from catenary.igh._ecrt import KernelTime
from catenary.igh.failures import refused, sdo_error
from catenary.igh.kernel_calls import Beside
from catenary.igh.library import Library
from catenary.link import forget_in_child
from catenary.model.device import Identity
from catenary.wire.al import AlState

SCAN_TIMEOUT = 30.0  # [s]: some devices answer their first SDO after seconds
EMPTY_TIMEOUT = 3.0  # [s]: a link that has just come up finds its devices within a second
PREOP_TIMEOUT = 15.0  # [s] without a change, from INIT; the master itself waits 10
LEAVE_OP_TIMEOUT = 2.0  # [s] without a change, from the last user's OP back
SETTLE_TIMEOUT = 60.0  # [s] for all devices: the master takes one after the other
LOOK = 0.010  # [s] between two looks
UPLOAD_LIMIT = 1 << 16  # bytes of an object


class Reservation:
    """Owns one kernel master that is reserved for this process. A `Link` that has a clock and
    carries no frames: the master sends its own."""

    def __init__(self, library: Library, index: int, time: KernelTime) -> None:
        self.library = library
        self.index = index
        self.time = time
        self.handle = 0
        self.beside = Beside()
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
        """Takes the master. LinkError where it cannot be had."""
        ctypes.set_errno(0)
        self.handle = self.library.ecrt_request_master(self.index) or 0
        if not self.handle:
            raise refused(self.index, ctypes.get_errno(), self.library)

    def close(self) -> None:
        """Gives the master back: its devices go to PRE-OP."""
        handle, self.handle = self.handle, 0
        if handle:
            self.beside.end()
            self.library.ecrt_release_master(handle)

    def forget(self) -> None:
        """Close the copies of a forked child: device file and process data. The kernel takes the
        master back when all copies are closed, so the parent's goes on."""
        handle, self.handle = self.handle, 0
        if handle:
            self.library.ecrt_release_master(handle)

    def renew(self) -> None:
        """Gives it back and takes it again: nothing of a configuration is left."""
        self.close()
        self.reserve()

    def ask(self, name: str, *arguments: object, what: str, hint: str = "") -> int:
        """A call with the master as its first argument."""
        return self.library.ask(name, self._held(), *arguments, what=what, hint=hint)

    def _held(self) -> int:
        """The handle, which libethercat never checks: a thread may come too late for it."""
        if not (handle := self.handle):
            raise RuntimeError("the master is not reserved any more")
        return handle

    # What the master knows of its devices

    def device_count(self) -> int:
        """Devices found, once the master has done scanning. LinkError without a cable."""
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
                    hint="ethercat slaves shows how far it is; dmesg what it waits for",
                )
            self.wait_until(self.now() + round(LOOK * 1e9), False)
        if not info.link_up:
            raise LinkError(
                f"master {self.index}: its network interface has no link",
                hint="plug the cable in and switch the first device on; ethercat master shows it",
            )
        return int(info.slave_count)

    def slave(self, position: int) -> abi.SlaveInfo:
        """One device."""
        info = abi.SlaveInfo()
        self.ask("ecrt_master_get_slave", position, ctypes.byref(info), what=f"device {position}")
        return info

    def aliases(self) -> list[int]:
        """Of all devices that are there now, by position; 0: none."""
        return [self.slave(position).alias for position in range(self._present())]

    def has(self, position: int, identity: Identity) -> bool:
        """Return True if that device is at a position now."""
        if position >= self._present():
            return False
        info = self.slave(position)
        return (info.vendor_id, info.product_code) == identity[:2]

    def wait_preop(self, patience: float = LEAVE_OP_TIMEOUT) -> None:
        """Wait until the master has brought its devices to PRE-OP, or nothing changes any more.

        In INIT nothing answers an SDO, and an application that has just given the master back
        leaves the devices on the way down. One with Ethernet over EtherCAT may stay in OP: it
        answers there, too. Devices may be lost meanwhile: only those that are present count.

        Args:
            patience: How long no state may change, if none is INIT [s].
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
            self.wait_until(self.now() + round(LOOK * 1e9), False)

    def _present(self) -> int:
        """Return how many devices the master has now, even while it scans."""
        info = abi.MasterInfo()
        self.ask("ecrt_master", ctypes.byref(info), what=f"master {self.index}")
        return int(info.slave_count)

    def sync_manager(self, position: int, index: int) -> abi.SyncInfo:
        """A SyncManager, without its PDOs."""
        info = abi.SyncInfo()
        what = f"device {position}, SyncManager {index}"
        self.ask("ecrt_master_get_sync_manager", position, index, ctypes.byref(info), what=what)
        return info

    def pdo(self, position: int, index: int, rank: int) -> abi.PdoInfo:
        """A PDO of a SyncManager, without its entries."""
        info = abi.PdoInfo()
        what = f"device {position}, SyncManager {index}, PDO {rank}"
        self.ask("ecrt_master_get_pdo", position, index, rank, ctypes.byref(info), what=what)
        return info

    def pdo_entry(self, position: int, index: int, rank: int, place: int) -> abi.PdoEntryInfo:
        """An entry of a PDO."""
        info = abi.PdoEntryInfo()
        what = f"device {position}, SyncManager {index}, PDO {rank}, entry {place}"
        call = "ecrt_master_get_pdo_entry"
        self.ask(call, position, index, rank, place, ctypes.byref(info), what=what)
        return info

    # Objects; both block, without the GIL

    def upload(self, position: int, index: int, subindex: int, limit: int = UPLOAD_LIMIT) -> bytes:
        """Reads an object. SdoAbort, or MailboxError where no answer came."""
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
        """Writes an object; `complete`: all subindices, from 0 on."""
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
