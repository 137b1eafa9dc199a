"""Methods about devices: list, states, registers, error counters and diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from catenary.bus import SubDevice
from catenary.bus.diagnosis import diagnose
from catenary.errors import DecodeError
from catenary.link import ring_of
from catenary.procedure.al_status_poll import Answer, survey
from catenary.procedure.error_counters import clear_error_counters, read_error_counters
from catenary.procedure.exchange import Procedure
from catenary.procedure.port_status import read_port_status
from catenary.procedure.registers import read_register
from catenary.procedure.station import Station
from catenary.remote import messages
from catenary.remote.program import Program, Work
from catenary.wire.al import ERROR_FLAG, AlStatus, status_code
from catenary.wire.dl import DlStatus
from catenary.wire.error_counters import ErrorCounters

REGISTERS_MAX = 1024  # bytes, as in `catenary reg`
BATCH = 16  # devices whose registers are decoded in one step of the acyclic queue


class Reading(NamedTuple):
    """Registers of one device; None: it did not answer."""

    answer: Answer
    counters: ErrorCounters | None
    status: DlStatus | None


def read_all(stations: Sequence[Station]) -> Procedure[list[Reading]]:
    """Read the states, error counters and links of devices in shared frames."""
    answers = yield from survey(stations)
    counters = yield from read_error_counters(stations)
    statuses = yield from read_port_status(stations)
    return [Reading(*each) for each in zip(answers, counters, statuses, strict=True)]


def devices(program: Program) -> Work[list[messages.Device]]:
    """Read the states and counters of all devices, by position."""
    found: list[messages.Device] = []
    subs = program.network.main.subs
    for first in range(0, len(subs), BATCH):
        batch = subs[first : first + BATCH]
        readings = yield from program.ask(read_all([sub.station for sub in batch]))
        for sub, reading in zip(batch, readings, strict=True):
            found.append(_device(program, sub, reading))
            yield None
    return found


def _device(program: Program, sub: SubDevice, reading: Reading) -> messages.Device:
    description, session = sub.description, program.session
    delays = program.network.main.clock_delays_ns
    state, error, code, text = state_of(reading.answer)
    return messages.Device(
        position=sub.position,
        network=program.network.number,
        name=sub.name,
        order=description.order,
        group=description.group,
        vendor=sub.identity.vendor,
        product=sub.identity.product,
        revision=sub.identity.revision,
        serial=sub.identity.serial,
        alias=sub.alias,
        state=state,
        error=error,
        al_status_code=code,
        al_status_text=text,
        parent=description.parent,
        parent_port=description.parent_port,
        ports=_ports(reading),
        delay_ns=delays[sub.position] if delays else None,
        coe=description.coe,
        axes=[axis.name for axis in session.plan.cycle.axes if axis.device == sub.position],
        optional=not session.watch.requires(sub.position),
        lost=reading.answer.word is None,
    )


def _ports(reading: Reading) -> list[messages.Port]:
    if reading.counters is None or reading.status is None:
        return []
    return [
        messages.Port(
            port=number,
            link=port.link,
            loop_closed=port.loop_closed,
            rx_errors=errors.invalid_frames + errors.symbol_errors,
            forwarded_errors=errors.forwarded,
            lost_links=errors.lost_links,
        )
        for number, (port, errors) in enumerate(
            zip(reading.status.ports, reading.counters.ports, strict=True)
        )
    ]


def state_of(answer: Answer) -> tuple[str, bool, int, str]:
    """Return the state, error flag, AL status code and its text; empty if there is no answer."""
    if answer.word is None:
        return "", False, 0, ""
    try:
        state = str(AlStatus.from_word(answer.word).state)
    except DecodeError:
        state = f"state {answer.word & 0xF}"
    text = status_code(answer.code).text if answer.code else ""
    return state, bool(answer.word & ERROR_FLAG), answer.code, text


def registers(program: Program, position: int, address: int, size: int) -> Work[bytes]:
    """Read registers of a device; see `Client.registers`."""
    if not 1 <= size <= REGISTERS_MAX or not 0 <= address <= 0x10000 - size:
        raise ValueError(
            f"0x{address:04X} + {size} bytes: use 1 to {REGISTERS_MAX} bytes below 0x10000"
        )
    station = program.device(position).station
    return (yield from program.ask(read_register(station, address, size)))


def clear_counters(program: Program) -> Work[messages.Done]:
    """Set the error counters of all devices to zero."""
    stations = [sub.station for sub in program.network.main.subs]
    yield from program.ask(clear_error_counters(stations))
    return messages.Done()


def diagnosis(program: Program) -> Work[messages.DiagnosisResult]:
    """Read the error counters and states of all devices, and locate faults."""
    main = program.session.main
    ring = ring_of(main.link) is not None
    found = yield from program.ask(diagnose(main.subs, ring=ring))
    problems = [
        messages.Problem(
            what=each.evidence,
            where=each.where,
            advice=each.advice,
            kind=str(each.kind),
            devices=list(each.devices),
        )
        for each in found.findings
    ]
    return messages.DiagnosisResult(problems=problems, text=str(found))


def emergencies(program: Program, position: int) -> list[messages.EmergencyEntry]:
    """Return the most recent emergencies of a device, oldest first."""
    from catenary.wire.drive_error import error_text

    return [
        messages.EmergencyEntry(
            error_code=each.error_code,
            error_register=each.error_register,
            data=each.data,
            text=error_text(each.error_code),
        )
        for each in program.device(position).emergencies
    ]
