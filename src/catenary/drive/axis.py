"""Process-data request of one CiA 402 axis, and its AxisPlan for the core."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from catenary.drive import objects
from catenary.drive.homing import HomingMethod
from catenary.drive.limits import AxisBounds, LimitOptions, make_bounds
from catenary.drive.objects import AxisObject, Unit
from catenary.drive.report import axis_report
from catenary.drive.sercos_settings import REACTIONS, SercosSettings
from catenary.drive.sercos_values import IDNS, sign
from catenary.drive.settings import DriveSettings, own_limits
from catenary.drive.units import AxisUnits
from catenary.errors import MappingError
from catenary.model.module import ConfiguredModule
from catenary.plan.axis_report import AxisReport
from catenary.plan.cycle import AxisPlan, Bank, Column, Number, NumberKind
from catenary.plan.numbers import Which
from catenary.plan.request import DeviceRequest, ImageLayout, ObjectReference, WrittenPdo
from catenary.plan.start_up_object import StartUp
from catenary.wire.cia402 import SLOT_OFFSET, Mode
from catenary.wire.sercos import idn_text

TARGETS: dict[int, AxisObject] = {
    Mode.CSP: objects.TARGET_POSITION,
    Mode.CSV: objects.TARGET_VELOCITY,
    Mode.CST: objects.TARGET_TORQUE,
    Mode.PP: objects.TARGET_POSITION,
    Mode.PV: objects.TARGET_VELOCITY,
}
TORQUES = (Unit.TORQUE, Unit.EFFORT)
MEASURED: dict[str, AxisObject] = {
    "position": objects.ACTUAL_POSITION,
    "velocity": objects.ACTUAL_VELOCITY,
    "torque": objects.ACTUAL_TORQUE,
}


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of a drive, with the options of the application and the settings of the drive."""

    name: str
    device: int  # position of the device
    slot: int
    modes: tuple[Mode, ...]  # the first one is the mode at the start
    units: AxisUnits
    options: LimitOptions
    measured: tuple[str, ...] = tuple(MEASURED)
    measured_required: bool = False  # True if the drive must map all of `measured`
    columns: Mapping[str, AxisObject] = field(default_factory=dict)
    # further columns, which the drive may lack
    optional_columns: Mapping[str, AxisObject] = field(default_factory=dict)
    divider: int = 1  # n: exchanged in every n-th cycle
    required: bool = True  # if True, a cycle without its device is an error
    homing: HomingMethod | None = None
    pdos: tuple[WrittenPdo, ...] = ()  # PDOs from the application
    objects: tuple[StartUp, ...] = ()  # start-up objects of its device
    modules: tuple[ConfiguredModule, ...] | None = None  # in the slots of its device
    settings: DriveSettings = field(default_factory=DriveSettings)  # read in PRE-OP
    sercos: SercosSettings | None = None  # of SERCOS drive number `slot`

    def index(self, base: int) -> int:
        """Return the index in this slot of the object that has the index `base` in slot 0."""
        return base + SLOT_OFFSET * self.slot

    @property
    def uses_torque(self) -> bool:
        """True if the axis measures, limits or commands a torque, or has one as a column."""
        return "torque" in self.measured or self.needs_torque

    @property
    def needs_torque(self) -> bool:
        """True if the axis needs the rated torque, which is the scale of its torques."""
        return (
            ("torque" in self.measured and self.measured_required)
            or Mode.CST in self.modes
            or self.options.torque_limit is not None
            or any(column.unit in TORQUES for column in self.columns.values())
        )

    @property
    def bounds(self) -> AxisBounds:
        """Limits and reactions in force.

        Raises:
            ConfigurationError: velocity_limit is infinite and no deceleration is known.
        """
        homing_offset = None if self.homing is None else self.homing.offset_counts(self.units)
        if self.sercos is not None:
            own = self.sercos.own_limits(self.units)
        else:
            own = own_limits(self.settings, self.units, homing_offset)
        return make_bounds(self.name, self.options, self.modes, own, self.units)

    def report(self, period_ns: int) -> AxisReport:
        """Return the description of the axis for the plan.

        Args:
            period_ns: period of the loop [ns].
        """
        return axis_report(
            self.name,
            self.modes,
            self.bounds,
            self.settings.reactions() if self.sercos is None else REACTIONS,
            period_ns * self.divider,
            self.units,
        )

    def device_request(self, start_up: tuple[tuple[int, int, bytes], ...] = ()) -> DeviceRequest:
        """Return the request of the axis to its device.

        Args:
            start_up: (index, subindex, data) of the objects to write at the start-up.
        """
        exchanged, optional = self._exchanged(), self._optional()
        references = [
            (each.output, self._reference(each, required=each not in optional))
            for each in exchanged
        ]
        sercos = self.sercos
        return DeviceRequest(
            outputs=tuple(each for is_output, each in references if is_output and each),
            inputs=tuple(each for is_output, each in references if not is_output and each),
            start_up=start_up,
            telegrams=() if sercos is None else sercos.telegrams,
            idns=() if sercos is None else sercos.idns,
            divider=self.divider,
            required=self.required,
            pdos=self.pdos,
            objects=self.objects,
            modules=self.modules,
        )

    def _exchanged(self) -> list[AxisObject]:
        """Return the objects of the request, each once."""
        outputs = [
            objects.CONTROLWORD,
            objects.MODE_TARGET,
            *(TARGETS[m] for m in self.modes if m in TARGETS),
        ]
        inputs = [objects.STATUSWORD, objects.MODE_ACTUAL, *(MEASURED[m] for m in self.measured)]
        if self.holds_on_loss:
            outputs.append(objects.TARGET_POSITION)
            inputs.append(objects.ACTUAL_POSITION)
        if self.uses_profile:
            outputs += objects.PROFILE_OBJECTS.values()
        columns = (*self.columns.values(), *self.optional_columns.values())
        return list(dict.fromkeys((*outputs, *inputs, *columns)))

    def sercos_values(self) -> tuple[list[AxisObject], list[AxisObject]]:
        """Return the values that the telegrams of a SERCOS drive must contain, and may contain.

        The actual position is always necessary in CSP, because the core holds it.
        """
        needed = [objects.ACTUAL_POSITION] if Mode.CSP in self.modes else []
        exchanged = [each for each in dict.fromkeys((*needed, *self._exchanged())) if each in IDNS]
        optional = self._optional() - set(needed)
        return [each for each in exchanged if each not in optional], [
            each for each in exchanged if each in optional
        ]

    def _reference(self, wanted: AxisObject, *, required: bool) -> ObjectReference | None:
        """Return an object of the request; None if a SERCOS drive does not exchange it."""
        if self.sercos is None:
            return wanted.reference(self.slot, required=required)
        value = self.sercos.value(wanted)
        if value is None:
            return None
        return ObjectReference(value.number, self.slot, value.bit_length, required)

    @property
    def uses_profile(self) -> bool:
        """True if the drive computes trajectories in one of the modes."""
        return not {Mode.PP, Mode.PV}.isdisjoint(self.modes)

    @property
    def holds_on_loss(self) -> bool:
        """True if the core changes to CSP when it stops the axis."""
        return self.options.on_loss == "csp_hold"

    def _optional(self) -> set[AxisObject]:
        """Return the objects that the process data may lack.

        These are velocity and torque, unless the application requests them by name. The mode is
        optional if it never changes, because the start-up list sets it. The rates of profiles are
        optional, because an SDO can write them.
        """
        optional = set() if self.measured_required else {MEASURED["velocity"], MEASURED["torque"]}
        if len(self.modes) == 1 and not self.holds_on_loss:
            optional |= {objects.MODE_TARGET, objects.MODE_ACTUAL}
        optional |= set(objects.PROFILE_OBJECTS.values()) | set(self.optional_columns.values())
        return optional - set(self.columns.values())

    def plan(self, layout: ImageLayout) -> AxisPlan:
        """Return the axis for the core, including objects that are mapped without a request.

        Raises:
            MappingError: The controlword or the statusword is not in the process data.
            ConfigurationError: velocity_limit is infinite and no deceleration is known.
        """
        bounds = self.bounds
        assert bounds.acceleration.value is not None
        assert bounds.deceleration.value is not None
        return AxisPlan(
            name=self.name,
            device=self.device,
            slot=self.slot,
            sync_unit=layout.sync_unit(self.device),
            mode=int(self.modes[0]),
            controlword=self._required(layout, objects.CONTROLWORD),
            statusword=self._required(layout, objects.STATUSWORD),
            mode_target=self._place(layout, objects.MODE_TARGET),
            mode_actual=self._place(layout, objects.MODE_ACTUAL),
            target_position=self._place(layout, objects.TARGET_POSITION),
            target_velocity=self._place(layout, objects.TARGET_VELOCITY),
            target_torque=self._place(layout, objects.TARGET_TORQUE),
            actual_position=self._place(layout, objects.ACTUAL_POSITION),
            actual_velocity=self._place(layout, objects.ACTUAL_VELOCITY),
            actual_torque=self._place(layout, objects.ACTUAL_TORQUE),
            position_demand=self._demand(layout, Mode.CSP, objects.POSITION_DEMAND),
            torque_demand=self._demand(layout, Mode.CST, objects.TORQUE_DEMAND),
            velocity_offset=self._column_place(layout, objects.VELOCITY_OFFSET),
            limits=bounds.limits,
            acceleration=bounds.acceleration.value,
            deceleration=bounds.deceleration.value,
            torque_slope=bounds.torque_slope.value,
            linear=self.units.metres_per_turn is not None,
            standstill=self.units.defaults.standstill,
            step_floor=self.units.defaults.step_limit,
            on_loss=bounds.on_loss,
            profile="cia402" if self.sercos is None else "sercos",
        )

    def _demand(self, layout: ImageLayout, mode: Mode, wanted: AxisObject) -> Number | None:
        """Return the place of a demand value; None if it is not mapped or the mode is not used.

        Only the application can request a demand value, as a column. A request by the axis could
        change a mapping that is sufficient without this value.
        """
        used = mode in self.modes or (mode is Mode.CSP and self.holds_on_loss)
        return self._place(layout, wanted) if used else None

    def _column_place(self, layout: ImageLayout, wanted: AxisObject) -> Number | None:
        """Return the place of an object; None unless the application requested it as a column."""
        written = ((column.index, column.subindex) for column in self.columns.values())
        if (wanted.index, wanted.subindex) not in written:
            return None
        return self._place(layout, wanted)

    def maps(self, wanted: AxisObject, layout: ImageLayout) -> bool:
        """Return True if an object is in the process data and its scale is known.

        The scale of a torque is unknown without the rated torque.

        Args:
            wanted: object of the axis.
            layout: layout of the process image.
        """
        return self._place(layout, wanted) is not None

    def column(self, name: str, wanted: AxisObject, layout: ImageLayout) -> Column:
        """Return the column of an object.

        Args:
            name: name of the column.
            wanted: object of the axis.
            layout: layout of the process image.

        Raises:
            MappingError: The object is not in the process data.
        """
        return Column(
            name=f"{self.name}.{name}",
            number=self._required(layout, wanted),
            bank=column_bank(wanted),
            device=self.device,
            sync_unit=layout.sync_unit(self.device),
            group=name,
        )

    def _required(self, layout: ImageLayout, wanted: AxisObject) -> Number:
        place = self._place(layout, wanted)
        if place is None:
            what = f"0x{self.index(wanted.index):04X}:{wanted.subindex:02X}"
            if self.sercos is not None and wanted in IDNS:
                what = idn_text(IDNS[wanted])
            raise MappingError(
                f"device {self.device} ({self.name}): {what} is not in its process data",
                hint="see the device's mapping with `catenary scan`",
            )
        return place

    def _place(self, layout: ImageLayout, wanted: AxisObject) -> Number | None:
        if self.sercos is not None:
            return self._sercos_place(layout, wanted)
        find = layout.output if wanted.output else layout.input
        which = Which(bit_length=wanted.bit_length)
        place = find(self.device, self.index(wanted.index), wanted.subindex, which)
        if place is None or (wanted.unit in TORQUES and self.units.rated_torque is None):
            return None
        # The layout has places and widths. CiA 402 defines the sign, unless the device states REAL.
        kind = NumberKind.SIGNED if wanted.signed else NumberKind.UNSIGNED
        if wanted.real or wanted.scale is not None:
            kind = NumberKind.REAL if wanted.real else kind
            return replace(place, kind=kind, scale=wanted.scale or 1.0, offset=0.0)
        if place.kind is not NumberKind.REAL:
            place = replace(place, kind=kind)
        return self.units.apply(place, wanted.unit)

    def _sercos_place(self, layout: ImageLayout, wanted: AxisObject) -> Number | None:
        """Return the place of a value in the telegrams, with the polarity of the position."""
        assert self.sercos is not None
        value = self.sercos.value(wanted)
        lacks_velocity = wanted.unit is Unit.VELOCITY and self.units.velocity_unit is None
        lacks_torque = wanted.unit in TORQUES and self.units.rated_torque is None
        if value is None or lacks_velocity or lacks_torque:
            return None
        find = layout.output if wanted.output else layout.input
        place = find(self.device, value.number, self.slot, Which(bit_length=value.bit_length))
        if place is None:
            return None
        if place.kind is not NumberKind.REAL:
            place = replace(place, kind=NumberKind.SIGNED if wanted.signed else NumberKind.UNSIGNED)
        scaled = self.units.apply(place, wanted.unit)
        return replace(scaled, scale=scaled.scale * sign(self.sercos.drive, value.number))


def column_bank(wanted: AxisObject) -> Bank:
    """Return the bank of the column of an object: float64 for SI values, int64 for raw values."""
    is_float = wanted.unit is not Unit.RAW or wanted.real or wanted.scale is not None
    return Bank.REAL if is_float else Bank.INTEGER


EXPONENTS = (
    -3,
    -6,
    -4,
    -5,
    -2,
    -1,
    0,
    -7,
    -8,
    -9,
)  # ms, us first: some drives need these


def interpolation_time(period_ns: int) -> tuple[int, int] | None:
    """Return 0x60C2 for a period as (value, exponent); None if it cannot represent the period.

    The period is value · 10^exponent s: 1 ms is 1·10⁻³ s, 250 us is 250·10⁻⁶ s.
    """
    for exponent in EXPONENTS:
        value, rest = divmod(period_ns, 10 ** (9 + exponent))
        if rest == 0 and 1 <= value <= 255:
            return value, exponent
    return None
