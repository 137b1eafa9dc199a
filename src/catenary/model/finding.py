"""Results of a diagnosis: where a fault is, the evidence, and advice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from catenary.model.topology import Cable


class Kind(StrEnum):
    """Kind of fault, by its location."""

    CABLE = "cable"  # including its plugs
    DEVICE = "device"
    POWER = "power"  # power of a device
    SILENT = "silent"  # a device does not answer, alone or with all devices behind it
    EVERYWHERE = "everywhere"  # a cause that affects the whole segment
    MAIN = "main"  # the MainDevice, its port or driver
    WIRING = "wiring"  # the wiring is not a tree


@dataclass(frozen=True, slots=True)
class Finding:
    """One fault. `devices` are the positions of the affected devices."""

    kind: Kind
    where: str
    evidence: str
    advice: str
    devices: tuple[int, ...] = ()
    cable: Cable | None = None

    def __str__(self) -> str:
        return f"{self.where}: {self.evidence}\n  {self.advice}"


@dataclass(frozen=True, slots=True)
class Names:
    """Names of devices in messages, by position."""

    names: tuple[str, ...]

    def device(self, position: int) -> str:
        """Return the name of a device."""
        name = self.names[position]
        return f"device {position} ({name})" if name else f"device {position}"

    def devices(self, positions: Sequence[int]) -> str:
        """Return the names of several devices."""
        return ", ".join(self.device(position) for position in positions)

    def end(self, position: int | None, port: int | None) -> str:
        """Return the name of one end of a cable.

        Args:
            position: Position of the device; None is the MainDevice.
            port: The port of the device.
        """
        return "the MainDevice" if position is None else f"{self.device(position)} port {port}"

    def cable(self, cable: Cable) -> str:
        """Return the name of a cable."""
        upper = self.end(cable.upper, cable.upper_port)
        return f"the cable between {upper} and {self.end(cable.lower, cable.lower_port)}"
