"""Configuration of the kernel master from a plan, and its activation."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field

from catenary.errors import ConfigurationError, SdoAbort
from catenary.igh import abi
from catenary.igh._ecrt import Exchange
from catenary.igh.address import Address, addresses
from catenary.igh.reservation import Reservation
from catenary.model.device import DeviceDescription, Direction, Pdo
from catenary.model.module import BY_IDENT, DETECTED_IDENTS
from catenary.plan.clocks import SyncPlan
from catenary.plan.cycle import ClockPlan
from catenary.plan.download import Download
from catenary.plan.layout import UnitLayout
from catenary.plan.modules import ident_difference
from catenary.plan.planner import Plan
from catenary.plan.start_up import WATCHDOG_DIVIDER, DevicePlan
from catenary.procedure.pdo import OPTIONAL_ABORTS

EMERGENCIES = 16  # largest number that the master stores for each device
REQUEST_SIZE = 256  # [bytes] of an object that a request reads; a longer one needs a blocking call
REGISTER_SIZE = 64

Copy = tuple[int, int, int]  # offset in the domain, offset in the image, size [bytes]


@dataclass(slots=True)
class Domain:
    """Location of one sync unit in the master's memory."""

    domain: int
    divider: int
    phase: int
    optional: bool
    data: int = 0
    size: int = 0
    outputs: list[Copy] = field(default_factory=list)
    inputs: list[Copy] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class DeviceConfiguration:
    """The master's handles for one device, valid until the master is deactivated."""

    position: int
    address: Address
    config: int
    sdo_request: int  # 0 without CoE
    register_request: int
    sync: SyncPlan | None  # None without SYNC signals


@dataclass(frozen=True, slots=True)
class Configuration:
    """The configuration of an activated master."""

    devices: tuple[DeviceConfiguration, ...]
    domains: tuple[Domain, ...]
    exchange: Exchange
    clock: ClockPlan | None


def configure(
    master: Reservation, plan: Plan, found: Sequence[DeviceDescription], epoch_ns: int
) -> Configuration:
    """Configure the master and activate it.

    After an error or an interruption, the master is still reserved and has no configuration.

    Args:
        master: The reserved master.
        plan: The plan of the loop.
        found: The descriptions of all devices, by position.
        epoch_ns: Offset from the loop's clock to the application time.

    Returns:
        The handles and the process images of the activated master.
    """
    try:
        return _configured(master, plan, found, epoch_ns)
    except BaseException:
        master.renew()
        raise


def _configured(
    master: Reservation, plan: Plan, found: Sequence[DeviceDescription], epoch_ns: int
) -> Configuration:
    domains = [_domain(master, unit) for unit in plan.layout.units]
    named = addresses([each.alias for each in found])
    devices = [
        _device(master, device, named[device.position], domains, plan, there.coe)
        for device, there in zip(plan.devices, found, strict=True)
    ]
    clock = plan.cycle.clock
    if clock is not None and clock.reference:
        config = devices[clock.reference].config
        master.ask("ecrt_master_select_reference_clock", config, what="the reference clock")
    interval_us = max(1, plan.cycle.period_ns // 1000)
    master.ask("ecrt_master_set_send_interval", interval_us, what="the send interval")
    master.ask("ecrt_master_activate", what=f"activating master {master.index}")
    for domain in domains:
        domain.data = master.library.ecrt_domain_data(domain.domain) or 0
        domain.size = master.library.ecrt_domain_size(domain.domain)
    sizes = (plan.cycle.output_size, plan.cycle.input_size)
    exchange = Exchange(master.time, master.library, master.handle, domains, *sizes)
    if clock is not None:
        bounds = (clock.bandwidth, clock.rate_limit_ns, clock.bound_ns)
        exchange.keep_clocks(clock.follow, plan.cycle.period_ns, epoch_ns, *bounds)
    return Configuration(tuple(devices), tuple(domains), exchange, clock)


def _domain(master: Reservation, unit: UnitLayout) -> Domain:
    handle = master.library.ecrt_master_create_domain(master.handle)
    if not handle:
        raise _no_handle(f"no domain for {unit.name}")
    return Domain(handle, unit.divider, unit.phase, unit.optional)


def _device(
    master: Reservation,
    plan: DevicePlan,
    address: Address,
    domains: Sequence[Domain],
    whole: Plan,
    coe: bool,
) -> DeviceConfiguration:
    library = master.library
    identity = plan.identity
    config = library.ecrt_master_slave_config(
        master.handle, *address, identity.vendor, identity.product
    )
    label = f"device {plan.position} ({plan.name})"
    if not config:
        raise _no_handle(f"{label}: no configuration")
    _configure_process_data(master, plan, config, label)
    for download in start_up_downloads(plan, label):
        data = ctypes.create_string_buffer(download.data, len(download.data))
        if download.optional:
            # Write it now: the master stops configuring a device that refuses a start-up SDO.
            _download_if_there(master, plan.position, download)
            continue
        place = (download.index, download.subindex, ctypes.addressof(data), len(data))
        what = f"{label}: start-up SDO 0x{download.index:04X}:{download.subindex:02X}"
        library.ask("ecrt_slave_config_sdo", config, *place, what=what)
    _configure_clock(master, plan, whole.cycle.clock, config, label)
    _register(master, plan, domains, config, label)
    library.ask("ecrt_slave_config_emerg_size", config, EMERGENCIES, what=f"{label}: emergencies")
    sdo = 0
    if coe:
        sdo = library.ecrt_slave_config_create_sdo_request(config, 0x1000, 0, REQUEST_SIZE)
    register = library.ecrt_slave_config_create_reg_request(config, REGISTER_SIZE)
    requests = sdo or 0, register or 0
    return DeviceConfiguration(plan.position, address, config, *requests, plan.sync)


def start_up_downloads(plan: DevicePlan, label: str) -> tuple[Download, ...]:
    """Return the start-up SDOs. The master writes all of them in PRE-OP, also those for SAFE-OP.

    Raises:
        ConfigurationError: A download of the ESI needs complete access, or a slot has another
            module than the plan expects.
    """
    _check_modules(plan, label)
    idents = () if plan.modules is None else plan.modules.downloads
    modules = (each for each in idents if not each.optional)  # not their number: it stays as it is
    before = (*modules, *plan.commands.in_pre_op, *plan.before_mapping)
    downloads = (*before, *plan.start_up, *plan.commands.in_safe_op)
    for each in downloads:
        if each.complete_access:
            raise _no_complete_access(label, each)
    return downloads


def _check_modules(plan: DevicePlan, label: str) -> None:
    """Compare the modules of a plan with those that the device detected, before any download."""
    modules = plan.modules
    if modules is None or modules.device.identify_by not in BY_IDENT:
        return
    different = ident_difference(modules, modules.device.detected or ())
    if different:
        raise ConfigurationError(
            f"{label}: its modules (0x{DETECTED_IDENTS:04X}) are not those of the plan "
            f"({modules.source}): {different}",
            hint="nothing was written; correct modules=, or plug the expected modules in and scan "
            "again",
        )


def _download_if_there(master: Reservation, position: int, download: Download) -> None:
    """Write an object. Ignore the abort codes for absent and read-only objects."""
    try:
        master.download(position, download.index, download.subindex, download.data)
    except SdoAbort as abort:
        if abort.code not in OPTIONAL_ABORTS:
            raise


def _configure_process_data(master: Reservation, plan: DevicePlan, config: int, label: str) -> None:
    """Configure PDOs and watchdogs. The master writes only values that differ from the device's."""
    mode = abi.WATCHDOG_ENABLE if plan.watchdog_ns else abi.WATCHDOG_DISABLE
    if plan.watchdog_ns:
        master.library.ask(
            "ecrt_slave_config_watchdog",
            *(config, WATCHDOG_DIVIDER, plan.watchdog_count),
            what=f"{label}: watchdog",
        )
    syncs = []
    for direction in Direction:
        output = direction is Direction.OUTPUT
        for assignment in plan.assignments(direction):
            pdos = (abi.PdoInfo * len(assignment.pdos))(*map(_pdo_info, assignment.pdos))
            sync = abi.SyncInfo(
                index=assignment.sync_manager,
                dir=abi.DIRECTION_OUTPUT if output else abi.DIRECTION_INPUT,
                n_pdos=len(pdos),
                pdos=pdos,
                watchdog_mode=mode if output else abi.WATCHDOG_DISABLE,
            )
            syncs.append(sync)
    if syncs:
        records = (abi.SyncInfo * len(syncs))(*syncs)
        at = ctypes.addressof(records)
        what = f"{label}: its PDOs"
        master.library.ask("ecrt_slave_config_pdos", config, len(syncs), at, what=what)


def _pdo_info(pdo: Pdo) -> abi.PdoInfo:
    entries = (abi.PdoEntryInfo * len(pdo.entries))(
        *(abi.PdoEntryInfo(*entry.place) for entry in pdo.entries)
    )
    return abi.PdoInfo(index=pdo.index, n_entries=len(entries), entries=entries)


def _configure_clock(
    master: Reservation, plan: DevicePlan, clock: ClockPlan | None, config: int, label: str
) -> None:
    """Configure SYNC0. It is later than the application time, so that the frames arrive first."""
    if plan.sync is None or clock is None:
        return
    shift_ns = plan.sync.shift_ns + clock.wire_ns + clock.allowance_ns
    sync = (plan.sync.assign_activate, plan.sync.cycle_ns, shift_ns % plan.sync.cycle_ns)
    what = f"{label}: distributed clocks"
    master.library.ask("ecrt_slave_config_dc", config, *sync, plan.sync.sync1_ns, 0, what=what)


def _register(
    master: Reservation, plan: DevicePlan, domains: Sequence[Domain], config: int, label: str
) -> None:
    """Map each SyncManager into the domain of its sync unit, and record the copies to make."""
    place = plan.layout
    for direction in Direction:
        output = direction is Direction.OUTPUT
        offset = place.output_offset if output else place.input_offset
        for assignment in plan.assignments(direction):
            if assignment.byte_length == 0:
                continue
            domain = domains[place.sync_unit]
            first = next(rank for rank, pdo in enumerate(assignment.pdos) if pdo.entries)
            bit = ctypes.c_uint32()
            at = (assignment.sync_manager, first, 0, domain.domain, ctypes.byref(bit))
            what = f"{label}: SyncManager {assignment.sync_manager} into a domain"
            call = "ecrt_slave_config_reg_pdo_entry_pos"
            found = master.library.ask(call, config, *at, what=what)
            copies = domain.outputs if output else domain.inputs
            copies.append((found, offset, assignment.byte_length))
            offset += assignment.byte_length


def _no_complete_access(label: str, download: Download) -> ConfigurationError:
    return ConfigurationError(
        f"{label}: start-up object {download.place} ({download.origin} {download.source}) needs "
        "complete access, which is not available with libethercat",
        hint="give its entries as start_up= objects; they replace it",
    )


def _no_handle(what: str) -> MemoryError:
    return MemoryError(f"{what}: the kernel is out of memory; see dmesg | tail")
