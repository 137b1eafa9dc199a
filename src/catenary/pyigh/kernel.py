"""The steps of a cycle over libethercat: one call per step, from Python."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

from catenary.bus import MainDevice
from catenary.igh import KernelMaster, abi
from catenary.igh.configure import Domain
from catenary.model.device import Direction
from catenary.plan.cycle import Number
from catenary.plan.numbers import Which
from catenary.plan.planner import Plan
from catenary.pyigh.request import ProcessDataRequest
from catenary.pyigh.slaves import Cell, RawObject, SlaveBase

WORDS = {
    (8, False): ctypes.c_uint8,
    (16, False): ctypes.c_uint16,
    (32, False): ctypes.c_uint32,
    (64, False): ctypes.c_uint64,
    (8, True): ctypes.c_int8,
    (16, True): ctypes.c_int16,
    (32, True): ctypes.c_int32,
    (64, True): ctypes.c_int64,
}


class MemoryCell:
    """A mapped object in a domain, in whole bytes. It is valid while the master is active."""

    def __init__(self, address: int, number: Number, signed: bool) -> None:
        self._value = WORDS[number.bit_length, signed].from_address(address)

    def read(self) -> int:
        return int(self._value.value)

    def write(self, value: int) -> None:
        self._value.value = value


class BitsCell:
    """A mapped object in a domain, of any bit length at any bit offset."""

    def __init__(self, address: int, number: Number, signed: bool) -> None:
        self._shift = number.bit_offset % 8
        self._mask = (1 << number.bit_length) - 1
        self._sign = 1 << (number.bit_length - 1) if signed else 0
        size = (self._shift + number.bit_length + 7) // 8
        self._bytes = (ctypes.c_uint8 * size).from_address(address)

    def read(self) -> int:
        value = int.from_bytes(self._bytes, "little") >> self._shift & self._mask
        return value - 2 * (value & self._sign)

    def write(self, value: int) -> None:
        word = int.from_bytes(self._bytes, "little") & ~(self._mask << self._shift)
        word |= (value & self._mask) << self._shift
        self._bytes[:] = list(word.to_bytes(len(self._bytes), "little"))


class KernelSteps:
    """Activated kernel master, with one method per step of the program's own cycle."""

    def __init__(
        self,
        main: MainDevice,
        kernel: KernelMaster,
        request: ProcessDataRequest,
        slaves: Sequence[SlaveBase],
        period: float,
    ) -> None:
        self._main = main
        self._kernel = kernel
        plan = main.plan(request, period=period)
        main.configure(plan)
        self._period_ns = plan.cycle.period_ns
        self._next = main.link.now()
        self._library = kernel.reservation.library
        self._master = kernel.reservation.handle
        domains = kernel.configuration.domains
        self._domains = [domain.domain for domain in domains]
        self._domain_state = abi.DomainState()
        self._slaves = slaves
        for slave in slaves:
            slave.bind(_cells(slave, plan, domains))

    def receive(self) -> None:
        self._library.ecrt_master_receive(self._master)

    def process(self) -> bool:
        complete = True
        for domain in self._domains:
            self._library.ecrt_domain_process(domain)
            self._library.ecrt_domain_state(domain, ctypes.byref(self._domain_state))
            complete = complete and self._domain_state.wc_state == abi.COUNTER_COMPLETE
        return complete

    def queue(self) -> None:
        for domain in self._domains:
            self._library.ecrt_domain_queue(domain)

    def write_time(self, time_ns: int) -> None:
        self._library.ecrt_master_application_time(self._master, time_ns)

    def send(self) -> None:
        self._library.ecrt_master_send(self._master)

    def wait(self) -> None:
        now = self._main.link.now()
        self._next += self._period_ns * max(1, -(-(now - self._next) // self._period_ns))
        self._main.link.wait_until(self._next, False)

    def status(self) -> tuple[int, int, bool]:
        state = abi.MasterState()
        self._library.ecrt_master_state(self._master, ctypes.byref(state))
        return int(state.slaves_responding), int(state.al_states), bool(state.link_up)

    def state(self, position: int) -> tuple[bool, bool, int]:
        config = self._kernel.configuration.devices[position].config
        state = abi.ConfigState()
        self._library.ecrt_slave_config_state(config, ctypes.byref(state))
        return bool(state.online), bool(state.operational), int(state.al_state)

    def close(self) -> None:
        for slave in self._slaves:
            slave.bind({})  # deactivation frees the memory of the domains
        self._main.leave()


def _cells(slave: SlaveBase, plan: Plan, domains: Sequence[Domain]) -> dict[tuple[int, int], Cell]:
    """Return the memory cell of each mapped object, by index and subindex."""
    cells: dict[tuple[int, int], Cell] = {}
    for each in slave.objects:
        output = each.direction is Direction.OUTPUT
        find = plan.layout.output if output else plan.layout.input
        number = find(slave.position, *each.place, Which(bit_length=each.bit_length))
        if number is not None:
            domain = domains[plan.layout.sync_unit(slave.position)]
            copies = domain.outputs if output else domain.inputs
            cells[each.place] = _cell(each, number, domain, copies)
    return cells


def _cell(
    each: RawObject, number: Number, domain: Domain, copies: Sequence[tuple[int, int, int]]
) -> Cell:
    at = number.bit_offset // 8
    address = next(
        domain.data + in_domain + at - in_image
        for in_domain, in_image, size in copies
        if in_image <= at < in_image + size
    )
    whole = number.bit_offset % 8 == 0 and (number.bit_length, each.signed) in WORDS
    return (MemoryCell if whole else BitsCell)(address, number, each.signed)
