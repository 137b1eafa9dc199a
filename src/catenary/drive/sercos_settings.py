"""Settings of a SERCOS drive for an axis: telegrams, parameters to write, and limits."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.drive.objects import AxisObject
from catenary.drive.sercos_values import idn_of
from catenary.drive.settings import OwnLimits
from catenary.drive.units import AxisUnits
from catenary.model.esi_settings import IdnCommand
from catenary.model.sercos_axis import SercosAxis, TelegramValue

REACTIONS = (
    "quick stop: drive off (bit 15 of S-0-0134), it brakes and then removes its torque",
    "disable operation: drive off, as a quick stop",
    "fault: the reaction of the drive to an error of class 1",
    "watchdog expired: the reaction of the drive to an error of class 1",
)
POSITION_LIMITS_ACTIVE = 0x10  # bit 4 of S-0-0055


@dataclass(frozen=True, slots=True)
class SercosSettings:
    """State of one drive for a plan. Limits are raw values; None if the drive lacks the IDN."""

    drive: SercosAxis  # with the telegrams of the plan
    telegrams: tuple[SercosAxis, ...] = ()  # of the whole device, to write; empty: unchanged
    idns: tuple[IdnCommand, ...] = ()  # to write
    position_max: int | None = None  # S-0-0049
    position_min: int | None = None  # S-0-0050
    velocity: int | None = None  # S-0-0091
    torque: int | None = None  # S-0-0092

    def value(self, wanted: AxisObject) -> TelegramValue | None:
        """Return the value of an object in the telegrams; None if they do not contain it."""
        number = idn_of(wanted)
        if number is None:
            return None
        return self.drive.output(number) if wanted.output else self.drive.input(number)

    def own_limits(self, units: AxisUnits) -> OwnLimits:
        """Return the limits of the drive at the joint, without those that are not plausible."""
        low, high = self._positions(units)
        velocity = torque = None
        if units.velocity_unit is not None and _is_plausible(self.velocity, 32):
            velocity = (self.velocity or 0) * abs(units.velocity_scale)
        if units.rated_torque is not None and _is_plausible(self.torque, 16):
            torque = (self.torque or 0) * abs(units.torque_scale)
        return OwnLimits(
            low,
            high,
            velocity,
            "S-0-0091 of the drive",
            torque,
            position_source="S-0-0049 and S-0-0050 of the drive",
            torque_source="S-0-0092 of the drive",
        )

    def _positions(self, units: AxisUnits) -> tuple[float | None, float | None]:
        low, high = self.position_min, self.position_max
        active = (self.drive.position.polarity or 0) & POSITION_LIMITS_ACTIVE
        if low is None or high is None or low >= high or not active:
            return None, None
        ends = [raw * units.position_scale + units.offset for raw in (low, high)]
        return min(ends), max(ends)


def _is_plausible(raw: int | None, bits: int) -> bool:
    return raw is not None and raw not in (0, 2**bits - 1, 2 ** (bits - 1) - 1)
