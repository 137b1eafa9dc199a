"""Tables of a machine file.

Their keys are the options of `Drives`, `ProcessData`, `StartUp`, `DistributedClock`, `Loop` and its
options classes. A missing key keeps the default of its option. The descriptions appear in errors
and in the JSON schema for editors.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias, TypeVar

import msgspec
from msgspec import UNSET, Meta, UnsetType

from catenary.machine.units import Dimension

FORMAT = "catenary-machine/1"

T = TypeVar("T")
PerAxis: TypeAlias = T | list[T]  # one value for all axes, or one per axis
Optional: TypeAlias = T | UnsetType


def _quantity(dimension: Dimension, unit: str, example: str) -> Meta:
    return Meta(
        description=f"number in {unit}, or text with a unit",
        examples=[example],
        extra={"dimension": dimension},
    )


Time = Annotated[float | str, _quantity("time", "s", "500 us")]
Position = Annotated[float | str, _quantity("position", "rad or m", "170 deg")]
Velocity = Annotated[float | str, _quantity("velocity", "rad/s or m/s", "90 deg/s")]
Acceleration = Annotated[float | str, _quantity("acceleration", "rad/s2 or m/s2", "400 deg/s2")]
Torque = Annotated[float | str, _quantity("torque", "N·m or N", "20 N·m")]
TorqueSlope = Annotated[float | str, _quantity("torque slope", "N·m/s or N/s", "100 N·m/s")]
Length = Annotated[float | str, _quantity("length", "m", "4 mm")]
Force = Annotated[float | str, _quantity("force", "N", "60 N")]
Word = Annotated[int, Meta(ge=0, le=0xFFFF)]
DoubleWord = Annotated[int, Meta(ge=0, le=0xFFFFFFFF)]
Object = Annotated[str, Meta(description="object, 0xINDEX:SUBINDEX", examples=["0x6000:11"])]
Mode = Literal["csp", "csv", "cst", "pp", "pv", "hm"]
TypeName = Annotated[str, Meta(description="data type", examples=["UINT", "REAL"])]
EsiPlace = Annotated[str, Meta(description="ESI file, or folder of ESI files")]
Divider = Annotated[int, Meta(description="n: exchange in every n-th cycle", ge=1)]


class Table(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Table of a machine file."""


class StopTable(Table, frozen=True, kw_only=True):
    """[loop.stop]: conditions for stopping the axes, and lost devices (cat.StopPolicy)."""

    late_limit: Optional[Time] = UNSET
    handover: Optional[Time] = UNSET
    on_axis_stopped: Optional[Literal["raise", "event"]] = UNSET
    command_timeout: Optional[Time] = UNSET
    lost_limit: Optional[int] = UNSET
    stop_deadline: Optional[Time] = UNSET
    raise_faults: Optional[bool] = UNSET
    on_return: Optional[Literal["restore", "hold"]] = UNSET
    on_replacement: Optional[Literal["restore", "hold"]] = UNSET


class SchedulingTable(Table, frozen=True, kw_only=True):
    """[loop.scheduling]: sleeping, receiving frames and several networks (cat.Scheduling)."""

    receive: Optional[Literal["poll", "wait", "busy"]] = UNSET
    busy_wait: Optional[Time] = UNSET
    switch_interval: Optional[Time] = UNSET
    collect_deadline: Optional[float] = UNSET
    exact_matching: Optional[bool] = UNSET
    quorum: Optional[int] = UNSET


class ClocksTable(Table, frozen=True, kw_only=True):
    """[clocks]: distributed clocks of the loop (cat.ClockOptions)."""

    lead: Optional[Literal["reference", "main"]] = UNSET
    reference: Optional[Annotated[str, Meta(description="name of a device")]] = UNSET
    margin: Optional[Time] = UNSET
    burst: Optional[int] = UNSET
    external: Optional[Annotated[str, Meta(description="PTP clock, such as /dev/ptp0")]] = UNSET


class LoopTable(Table, frozen=True, kw_only=True):
    """[loop]: options of the loop (cat.Loop)."""

    period: Optional[Time] = UNSET
    execution: Optional[Literal["threaded", "inline"]] = UNSET
    enable: Optional[bool] = UNSET
    watchdog: Optional[Time] = UNSET
    cpu: Optional[int] = UNSET
    priority: Optional[Annotated[int, Meta(description="SCHED_FIFO priority", ge=1, le=99)]] = UNSET
    log: Optional[Annotated[int, Meta(description="number of cycles", ge=1)]] = UNSET
    log_axes: Optional[bool] = UNSET
    diagnosis: Optional[Time] = UNSET
    stop: StopTable = StopTable()
    scheduling: SchedulingTable = SchedulingTable()


class IdentityTable(Table, frozen=True, kw_only=True):
    """Identity of a device (object 0x1018), which is checked when the machine is opened."""

    vendor: DoubleWord
    product: DoubleWord
    revision: Optional[DoubleWord] = UNSET
    serial: Optional[DoubleWord] = UNSET


class StartUpTable(Table, frozen=True, kw_only=True):
    """Object to write to the device between PRE-OP and SAFE-OP (cat.StartUp)."""

    object: Object
    value: bool | int | float | str
    type: Optional[TypeName] = UNSET
    before_mapping: Optional[bool] = UNSET
    verify: Optional[bool] = UNSET
    complete_access: Optional[bool] = UNSET
    comment: str = ""


class DeviceTable(Table, frozen=True, kw_only=True):
    """[[device]]: device with its address (alias or position) and its identity."""

    name: Annotated[str, Meta(description="name in this file", min_length=1)]
    identity: IdentityTable
    alias: Optional[Annotated[int, Meta(description="station alias", ge=1, le=0xFFFF)]] = UNSET
    position: Optional[Annotated[int, Meta(description="the first is 0", ge=0, le=0xFFFF)]] = UNSET
    required: Annotated[bool, Meta(description="false if the device may be absent")] = True
    esi: Optional[EsiPlace] = UNSET
    op_mode: Optional[Annotated[str, Meta(description="OpMode from the ESI or SII")]] = UNSET
    modules: Optional[
        Annotated[
            list[str | int],
            Meta(description='module of each slot: type, name or ident; "" for an empty slot'),
        ]
    ] = UNSET
    start_up: list[StartUpTable] = []
    comment: str = ""


class ColumnTable(Table, frozen=True, kw_only=True):
    """Additional object of each axis, with its index in slot 0."""

    name: str
    object: Object
    type: TypeName
    scale: Optional[Annotated[float, Meta(description="value of one count in SI units")]] = UNSET
    unit: str = ""
    output: Annotated[bool, Meta(description="true if the column is written")] = False


class ClockTable(Table, frozen=True, kw_only=True):
    """Distributed clock of the devices of a role (cat.DistributedClock)."""

    op_mode: Optional[str] = UNSET
    sync0: Optional[Time] = UNSET
    sync1: Optional[Time] = UNSET
    shift: Optional[Time] = UNSET
    assign_activate: Optional[Word] = UNSET


class HomingTable(Table, frozen=True, kw_only=True):
    """Homing by the drive (cat.drive.HomingMethod)."""

    method: Optional[int] = UNSET
    speed: Optional[Velocity] = UNSET
    slow: Optional[Velocity] = UNSET
    acceleration: Optional[Acceleration] = UNSET
    offset: Optional[Position] = UNSET


class TouchProbeTable(Table, frozen=True, kw_only=True):
    """`touch_probe` of drives (cat.drive.TouchProbe)."""

    probes: Optional[list[Literal[1, 2]]] = UNSET
    edges: Optional[list[Literal["rising", "falling"]]] = UNSET
    times: Optional[bool] = UNSET
    counters: Optional[bool] = UNSET
    toggles: Optional[bool] = UNSET


class DrivesTable(Table, frozen=True, kw_only=True):
    """[drives.NAME]: drives of one or more axes (cat.Drives). A list has one value per axis."""

    axes: Annotated[
        list[str], Meta(description='names of devices, or "device/slot" for one of several axes')
    ]
    counts_per_turn: PerAxis[float]
    names: Optional[Annotated[list[str], Meta(description="names of the axes")]] = UNSET
    mode: Optional[PerAxis[Mode]] = UNSET
    other_modes: Optional[list[Mode]] = UNSET
    gear_ratio: Optional[PerAxis[float]] = UNSET
    metres_per_turn: Optional[PerAxis[Length]] = UNSET
    direction: Optional[PerAxis[Literal[1, -1]]] = UNSET
    offset: Optional[PerAxis[Position]] = UNSET
    velocity_unit: Optional[PerAxis[float]] = UNSET
    rated_torque: Optional[PerAxis[float]] = UNSET
    position_min: Optional[PerAxis[Position]] = UNSET
    position_max: Optional[PerAxis[Position]] = UNSET
    velocity_limit: Optional[PerAxis[Velocity]] = UNSET
    torque_limit: Optional[PerAxis[Torque]] = UNSET
    force_limit: Optional[PerAxis[Force]] = UNSET
    step_limit: Optional[PerAxis[Position]] = UNSET
    acceleration_limit: Optional[PerAxis[Acceleration]] = UNSET
    deceleration_limit: Optional[PerAxis[Acceleration]] = UNSET
    torque_slope: Optional[PerAxis[TorqueSlope]] = UNSET
    on_loss: Optional[PerAxis[Literal["quick_stop", "disable", "csp_hold"]]] = UNSET
    homing: Optional[PerAxis[HomingTable]] = UNSET
    measured: Optional[list[Literal["position", "velocity", "torque"]]] = UNSET
    columns: Optional[list[str | ColumnTable]] = UNSET
    touch_probe: Optional[bool | TouchProbeTable] = UNSET
    required: Optional[bool] = UNSET
    divider: Optional[Divider] = UNSET
    clock: Optional[bool | ClockTable] = UNSET
    pdos: Optional[list[Word | str] | dict[str, list[tuple[Word, int, int]]]] = UNSET


class ChannelTable(Table, frozen=True, kw_only=True):
    """Object in the process data of a device."""

    object: Object
    type: Optional[TypeName] = UNSET
    scale: Optional[Annotated[float, Meta(description="value of one count in SI units")]] = UNSET
    unit: Annotated[str, Meta(description="unit of the value, for display")] = ""


class ProcessDataTable(Table, frozen=True, kw_only=True):
    """[process_data.NAME]: values of one device by name (cat.ProcessData).

    Without `inputs` or `outputs`, the mapped objects have the names from the device.
    """

    device: Annotated[str, Meta(description="name of a device")]
    inputs: Optional[dict[str, Object | ChannelTable]] = UNSET
    outputs: Optional[dict[str, Object | ChannelTable]] = UNSET
    safe: dict[str, bool | int | float] = {}
    pdos: list[Word | str] | dict[str, list[str]] = {}
    required: Optional[bool] = UNSET
    divider: Optional[Divider] = UNSET
    clock: Optional[bool | ClockTable] = UNSET


class MachineTables(Table, frozen=True, kw_only=True):
    """Machine with its devices, drives, process data and loop."""

    format: Literal["catenary-machine/1"]
    name: str = ""
    target: Optional[Annotated[str, Meta(description='"eth0", "eth0,eth1", "virtual:FILE"')]] = (
        UNSET
    )
    esi: Optional[EsiPlace] = UNSET
    loop: LoopTable = LoopTable()
    clocks: ClocksTable = ClocksTable()
    device: list[DeviceTable] = []
    drives: dict[str, DrivesTable] = {}
    process_data: dict[str, ProcessDataTable] = {}


def json_schema() -> dict[str, object]:
    """Return the JSON schema (draft 2020-12) of machine files, for editors."""
    schema = msgspec.json.schema(MachineTables)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
