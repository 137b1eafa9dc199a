"""What a diagnosis says: where a fault is, what shows it, what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from catenary.model.topology import Cable


class Kind(StrEnum):
    """Where to look."""

    CABLE = "cable"  # with its plugs
    DEVICE = "device"
    POWER = "power"  # of a device
    SILENT = "silent"  # a device, or all from one on, does not answer
    EVERYWHERE = "everywhere"  # a cause that the whole segment shares
    MAIN = "main"  # the MainDevice, its port or driver
    WIRING = "wiring"  # what is no tree


@dataclass(frozen=True, slots=True)
class Finding:
    """One fault. `devices`: the positions it is about."""

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
    """How devices are called; by position."""

    names: tuple[str, ...]

    def device(self, position: int) -> str:
        name = self.names[position]
        return f"device {position} ({name})" if name else f"device {position}"

    def devices(self, positions: Sequence[int]) -> str:
        return ", ".join(self.device(position) for position in positions)

    def end(self, position: int | None, port: int | None) -> str:
        """One end of a cable."""
        return "the MainDevice" if position is None else f"{self.device(position)} port {port}"

    def cable(self, cable: Cable) -> str:
        upper = self.end(cable.upper, cable.upper_port)
        return f"the cable between {upper} and {self.end(cable.lower, cable.lower_port)}"
