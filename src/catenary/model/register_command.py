"""Register command of an ENI: a datagram that is sent at a transition of a device's state."""

from __future__ import annotations

from dataclasses import dataclass

DEFAULT_TIMEOUT = 1.0  # [s], where the file gives none


@dataclass(frozen=True, slots=True)
class Validation:
    """Expected reply of a command (`Validate`)."""

    data: bytes
    mask: bytes  # as long as `data`
    timeout: float  # [s]

    @property
    def is_masked(self) -> bool:
        """True if some bits are not compared."""
        return any(each != 0xFF for each in self.mask)

    def accepts(self, found: bytes) -> bool:
        """Return True if the bits of the mask have the expected values."""
        start = found[: len(self.data)]
        if len(start) < len(self.data):
            return False
        return all((a ^ b) & m == 0 for a, b, m in zip(start, self.data, self.mask, strict=True))


@dataclass(frozen=True, slots=True)
class RegisterCommand:
    """One datagram (`InitCmds/InitCmd`, ETG.2100).

    If the working counter or the reply is wrong, it is repeated up to `retries` times. A reply with
    a `validation` is read until it is right or the time of the validation is over.
    """

    transitions: tuple[str, ...]  # such as ("IP",): INIT to PRE-OP
    command: int  # number of the command, wire.datagram.EcatCommand
    address: int  # 32 bits as on the wire: ADP | ADO << 16, or the logical address
    data: bytes
    count: int | None = None  # expected working counter; None: any
    retries: int = 0
    timeout: float = 0.0  # [s]; 0: DEFAULT_TIMEOUT
    validation: Validation | None = None
    before_slave: bool = False  # sent by the MainDevice before the commands of the devices
    comment: str = ""
    source: object = ""  # file and line

    @property
    def offset(self) -> int:
        """Address in the memory of the device (ADO)."""
        return self.address >> 16

    @property
    def device(self) -> int:
        """Address of the device (ADP): its position, negative, or its station address."""
        return self.address & 0xFFFF

    @property
    def place(self) -> str:
        """Registers as text, such as "0x0410" or "0x0600 to 0x060F"."""
        last = self.offset + max(len(self.data), 1) - 1
        first = f"0x{self.offset:04X}"
        return first if last == self.offset else f"{first} to 0x{last:04X}"

    def __str__(self) -> str:
        """Return place and comment, such as "0x0410 (set PDI watchdog)"."""
        return f"{self.place} ({self.comment})" if self.comment else self.place
