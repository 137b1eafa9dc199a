"""Messages of the remote service of a share, as frozen values: msgpack arrays and maps.

A client sends a `Request` in one packet of a SOCK_SEQPACKET socket. The service answers with one or
more `Response` packets, whose parts form the encoded result. `RESULTS` names the type of each
method's result. JSON has the same field names.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import msgspec

from catenary.share.choice import Choice

VERSION = 1
MESSAGE_SIZE = 64 * 1024  # largest message [bytes]
PART_SIZE = 32 * 1024  # largest part of a result [bytes]
RESULT_SIZE = 1024 * 1024  # largest result [bytes]
TIMEOUT = 5.0  # default deadline of a request [s]
TIMEOUT_MAX = 60.0  # [s]

Detail: TypeAlias = bool | int | float | str | None
Value: TypeAlias = Any  # a number, text, bytes, or None; msgspec refuses their union


class Request(msgspec.Struct, frozen=True, array_like=True):
    """Call of a method. `timeout` is the time after which no answer is needed [s]."""

    version: int
    serial: int  # chosen by the client; the response repeats it
    method: str
    timeout: float
    params: dict[str, Any] = {}


class Failure(msgspec.Struct, frozen=True, kw_only=True):
    """Error of a request. `kind` is the name of its class in `catenary.errors` or in Python."""

    kind: str
    message: str
    hint: str = ""
    details: dict[str, Detail] = {}  # further arguments of the class


class Response(msgspec.Struct, frozen=True, array_like=True):
    """Part of the answer to a request: a part of the encoded result, or an error."""

    version: int
    serial: int
    error: Failure | None = None
    part: bytes = b""
    more: bool = False  # True if another part follows


class Hello(msgspec.Struct, frozen=True, kw_only=True):
    """Identity of the program that serves the requests."""

    version: str  # of Catenary
    pid: int
    program: str
    share: str
    period: float  # [s]
    networks: int
    jog: bool  # True if clients may jog axes
    virtual: bool  # True if `virtual_cable` and `virtual_power` work
    started: float  # UTC, seconds since 1970
    execution: str  # "threaded" or "inline"
    background: bool  # True if a background thread iterates the loop


class Port(msgspec.Struct, frozen=True, kw_only=True):
    """One port of a device, and its errors since power-up or `clear_counters`."""

    port: int
    link: bool  # True if a physical link is present
    loop_closed: bool  # True if the port returns frames instead of sending them
    rx_errors: int
    forwarded_errors: int
    lost_links: int


class Device(msgspec.Struct, frozen=True, kw_only=True):
    """A device of the segment, with its present state."""

    position: int
    network: int
    name: str
    order: str
    group: str
    vendor: int
    product: int
    revision: int
    serial: int
    alias: int
    state: str  # INIT, PRE-OP, SAFE-OP, OP, BOOT; empty if it does not answer
    error: bool
    al_status_code: int
    al_status_text: str
    parent: int | None  # position of the device before it in the tree
    parent_port: int | None
    ports: list[Port]
    delay_ns: int | None  # propagation delay from the first clock
    coe: bool  # True if it has an object dictionary
    axes: list[str]
    optional: bool
    lost: bool


class Axis(msgspec.Struct, frozen=True, kw_only=True):
    """An axis of the loop, and its limits in rad and N·m, or in m and N if it is linear."""

    name: str
    network: int
    device: int
    unit: str  # "rad" or "m"
    mode: int  # 0x6060 at the start of the loop
    position_min: float | None
    position_max: float | None
    velocity_limit: float | None
    torque_limit: float | None
    acceleration: float | None
    deceleration: float | None


class ObjectEntry(msgspec.Struct, frozen=True, kw_only=True):
    """An entry of an object dictionary, as the device or its ESI describes it."""

    index: int
    subindex: int
    object_name: str
    name: str
    type: str
    bits: int
    access: str  # "r", "w" or "rw"; then " PS" if it is limited to these states (P, S, O)
    unit: str
    options: dict[str, str]  # value as text → meaning
    minimum: float | None
    maximum: float | None


class Objects(msgspec.Struct, frozen=True, kw_only=True):
    """A page of an object dictionary. `next` is the `after` of the next page; None: the end."""

    entries: list[ObjectEntry]
    next: int | None
    notes: list[str] = []  # missing or undocumented parts


class SdoValue(msgspec.Struct, frozen=True, kw_only=True):
    """Value of an entry of an object dictionary."""

    data: bytes
    value: Value  # by the type; None without a type
    type: str  # such as "UDINT"; empty if unknown
    text: str  # value with its unit and meaning


class State(msgspec.Struct, frozen=True, kw_only=True):
    """EtherCAT state of a device."""

    state: str
    error: bool
    al_status_code: int
    al_status_text: str


class Problem(msgspec.Struct, frozen=True, kw_only=True):
    """A fault that the diagnosis found."""

    what: str
    where: str
    advice: str
    kind: str = ""
    devices: list[int] = []


class DiagnosisResult(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a diagnosis."""

    problems: list[Problem]
    text: str


class EmergencyEntry(msgspec.Struct, frozen=True, kw_only=True):
    """An emergency message of a device."""

    error_code: int
    error_register: int
    data: bytes
    text: str


class EventEntry(msgspec.Struct, frozen=True, kw_only=True):
    """Event of a loop, and advice."""

    serial: int
    number: int  # of the last cycle before the event
    kind: str
    message: str
    time: float  # on the clock of the loop [s]
    position: int | None
    details: dict[str, Any]
    advice: str


class Events(msgspec.Struct, frozen=True, kw_only=True):
    """Events after a serial number, oldest first."""

    events: list[EventEntry]
    lost: int  # number of overwritten events


class Figures(msgspec.Struct, frozen=True, kw_only=True):
    """Statistics of a phase of the cycle [s]."""

    median: float
    p99: float
    p999: float
    max: float
    count: int


class Timing(msgspec.Struct, frozen=True, kw_only=True):
    """Timing of the loop since it was opened."""

    figures: dict[str, Figures]  # by phase
    counters: dict[str, int]
    verdict: list[str]
    scheduling: str
    histograms: dict[str, list[tuple[float, float, int]]] = {}  # phase → (from, to [s], count)


class ClockEntry(msgspec.Struct, frozen=True, kw_only=True):
    """Distributed clock of a device. Differences from the reference clock [s]."""

    position: int
    name: str
    reference: bool
    difference: float | None


class Clocks(msgspec.Struct, frozen=True, kw_only=True):
    """Distributed clocks of a loop. All fields are empty if the loop has none."""

    clocks: list[ClockEntry]
    locked: bool
    text: str


class Text(msgspec.Struct, frozen=True, kw_only=True):
    """Text for a person."""

    text: str


class Parameter(msgspec.Struct, frozen=True, kw_only=True):
    """Parameter of a law. None: no limit."""

    value: float | list[float]
    minimum: float | None
    maximum: float | None
    unit: str


class LawEntry(msgspec.Struct, frozen=True, kw_only=True):
    """A law of the loop, and its parameters by name."""

    name: str
    running: bool
    parameters: dict[str, Parameter]


class Modes(msgspec.Struct, frozen=True, kw_only=True):
    """Operating modes and presets of a program."""

    mode: str | None  # present mode; None until the program sets it
    modes: list[Choice]
    presets: list[Choice]


class Done(msgspec.Struct, frozen=True, kw_only=True):
    """Completion of a request. `note` describes a side effect; empty without one."""

    note: str = ""


RESULTS: dict[str, Any] = {
    "hello": Hello,
    "devices": list[Device],
    "axes": list[Axis],
    "objects": Objects,
    "sdo_read": SdoValue,
    "sdo_write": SdoValue,
    "set_state": State,
    "reset_error": State,
    "registers": bytes,
    "diagnosis": DiagnosisResult,
    "emergencies": list[EmergencyEntry],
    "events": Events,
    "clear_counters": Done,
    "timing": Timing,
    "clocks": Clocks,
    "plan": Text,
    "laws": list[LawEntry],
    "set_parameters": Done,
    "modes": Modes,
    "set_mode": Done,
    "run_preset": Done,
    "home": Done,
    "move": Done,
    "virtual_cable": Done,
    "virtual_power": Done,
    "virtual_push": Done,
}
# Methods that publish an event RemoteWrite. Pushes are too frequent. Accepted modes and presets are
# events RequestAccepted.
WRITES = (
    "sdo_write",
    "set_state",
    "reset_error",
    "clear_counters",
    "set_parameters",
    "home",
    "move",
    "virtual_cable",
    "virtual_power",
)
