"""Stored files of a virtual device, and the rules for their access."""

from __future__ import annotations

from catenary.virtual.foe.firmware import Flash
from catenary.virtual.foe.options import DeviceFiles

# Error codes, ETG.1000.6 §5.8.6
NOT_FOUND, ACCESS_DENIED, DISK_FULL = 0x8001, 0x8002, 0x8003
BOOTSTRAP_ONLY, NOT_IN_BOOTSTRAP, NO_RIGHTS = 0x8008, 0x8009, 0x800A


class Refusal(Exception):
    """Refused access, with its error code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:04X}")
        self.code = code


def _encoded(content: object) -> bytes:
    return content if isinstance(content, bytes) else str(content).encode()


class FileStore:
    """Files of one device, and its firmware. It keeps its content without power."""

    def __init__(self, options: DeviceFiles, product: int) -> None:
        self.options = options
        self.files = {name: _encoded(content) for name, content in options.contents.items()}
        firmware = options.firmware
        self.flash = None if firmware is None else Flash(product, firmware.version)

    def read(self, name: str, password: int, *, boot: bool) -> bytes:
        """Return the content of a file.

        Args:
            name: File name.
            password: Password of the request.
            boot: True if the device is in BOOT.

        Raises:
            Refusal: The file does not exist, or the access is not permitted.
        """
        self._check(name, password, boot=boot)
        if self._is_firmware(name):
            return self._firmware_file()
        if name not in self.files:
            raise Refusal(NOT_FOUND)
        return self.files[name]

    def _firmware_file(self) -> bytes:
        firmware, flash = self.options.firmware, self.flash
        if firmware is None or flash is None or firmware.reading == "refused":
            raise Refusal(ACCESS_DENIED)
        return flash.file if firmware.reading == "same" else bytes(len(flash.file))

    def begin(self, name: str, password: int, *, boot: bool) -> None:
        """Prepare the write of a file. The firmware is erased.

        Args:
            name: File name.
            password: Password of the request.
            boot: True if the device is in BOOT.

        Raises:
            Refusal: The access is not permitted.
        """
        self._check(name, password, boot=boot)
        if name in self.options.write_protected:
            raise Refusal(ACCESS_DENIED)
        if self._is_firmware(name):
            if self.flash is not None:
                self.flash.erase()
        elif name not in self.files and not self.options.new_files:
            raise Refusal(NOT_FOUND)

    def check_size(self, name: str, size: int) -> None:
        """Check whether the memory is sufficient for a file of `size` bytes.

        Raises:
            Refusal: The memory is full.
        """
        others = 0
        if not self._is_firmware(name):
            others = sum(len(data) for other, data in self.files.items() if other != name)
        if others + size > self.options.size_limit:
            raise Refusal(DISK_FULL)

    def finish(self, name: str, data: bytes) -> None:
        """Store a complete file.

        Raises:
            Refusal: The file is a firmware image that is not valid.
        """
        if not self._is_firmware(name) or self.flash is None:
            self.files[name] = data
        elif code := self.flash.program(data):
            raise Refusal(code)

    def _check(self, name: str, password: int, *, boot: bool) -> None:
        if self.options.password and password != self.options.password:
            raise Refusal(NO_RIGHTS)
        for_boot = self._is_firmware(name) or name in self.options.bootstrap_only
        if for_boot and not boot:
            raise Refusal(BOOTSTRAP_ONLY)
        if boot and not for_boot:
            raise Refusal(NOT_IN_BOOTSTRAP)

    def _is_firmware(self, name: str) -> bool:
        firmware = self.options.firmware
        return firmware is not None and name == firmware.name
