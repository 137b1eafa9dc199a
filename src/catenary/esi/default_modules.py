"""Modular device with the modules of its default configuration (ETG.5001, MDP)."""

from __future__ import annotations

from catenary.esi.device import EsiDevice
from catenary.esi.placement import default_placements, with_placements


def with_default_modules(device: EsiDevice) -> EsiDevice:
    """Return the device with the PDOs, objects and commands of its default modules.

    A device without slots, or without default modules, is returned unchanged.
    """
    return with_placements(device, default_placements(device))
