"""Commands of an ENI: datagrams and mailbox requests at transitions of the states."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.esi.eni.fields import Fields
from catenary.esi.eni.known import PROTOCOLS
from catenary.esi.eni.own_registers import LOGICAL
from catenary.esi.eni.values import MailboxCommand, RegisterCommand, Validation
from catenary.esi.xml import Element
from catenary.model.esi_settings import InitCommand
from catenary.wire.datagram import EcatCommand

STATES = "IPSOB"  # letters of a transition: INIT, PRE-OP, SAFE-OP, OP, BOOT
MILLISECOND = 1e-3
DOWNLOAD = 1  # Ccs of CoE
SOE_VALUE = 0x40  # Elements of SoE: the value of the IDN
TIMEOUT_MAX = 600_000  # of a command [ms]
DATA_MAX = 1486  # of one datagram [bytes], ETG.1000.4


def read_register_commands(parent: Element, fields: Fields) -> tuple[RegisterCommand, ...]:
    """Return the commands in `parent/InitCmds`, in the order of the file."""
    lists = parent.all("InitCmds")
    return tuple(_register_command(each, fields) for one in lists for each in one.all("InitCmd"))


def _register_command(element: Element, fields: Fields) -> RegisterCommand:
    command = fields.number(element, "Cmd", bits=8)
    if command not in list(EcatCommand):
        fields.refuse(element, f"{command} is not a command of EtherCAT", tag="Cmd")
    data = _command_data(element, fields)
    return RegisterCommand(
        transitions=_transitions(element, fields),
        command=command,
        address=read_address(element, fields, command),
        data=data,
        count=_optional(element, fields, "Cnt"),
        retries=fields.number(element, "Retries", bits=16, default=0),
        timeout=read_timeout(element, fields),
        validation=_validation(element, fields, len(data)),
        before_slave=fields.flag(element, "BeforeSlave"),
        comment=fields.text(element, "Comment"),
        source=fields.source(element),
    )


def read_address(element: Element, fields: Fields, command: int) -> int:
    """Return the address of a datagram: ADP and ADO, or a logical address.

    Args:
        element: The command.
        fields: The reader.
        command: The number of the command.
    """
    if command in LOGICAL or element.find("Ado") is None:
        return fields.number(element, "Addr")
    device = fields.signed(element, "Adp", bits=16) & 0xFFFF
    return device | fields.number(element, "Ado", bits=16) << 16


def _command_data(element: Element, fields: Fields) -> bytes:
    data = fields.data(element, "Data")
    if data is None:
        data = bytes(_limited(element, fields))
    if not 0 < len(data) <= DATA_MAX:
        fields.refuse(element, f"{len(data)} bytes of data; a datagram has 1 to {DATA_MAX}")
    return data


def _limited(element: Element, fields: Fields) -> int:
    length = fields.number(element, "DataLength", bits=16)
    if length > DATA_MAX:
        fields.refuse(element, f"{length} bytes; at most {DATA_MAX}", tag="DataLength")
    return length


def _validation(element: Element, fields: Fields, length: int) -> Validation | None:
    validate = element.find("Validate")
    if validate is None:
        return None
    data = fields.data(validate, "Data")
    if not data:
        fields.refuse(validate, "Validate has no Data")
    mask = fields.data(validate, "DataMask")
    mask = b"\xff" * len(data) if mask is None else mask
    if len(mask) != len(data) or len(data) > length:
        fields.refuse(
            validate,
            f"{len(data)} bytes of Data and {len(mask)} of DataMask for a datagram of {length}",
        )
    return Validation(data, mask, read_timeout(validate, fields))


def read_timeout(element: Element, fields: Fields) -> float:
    """Return the child Timeout [s]; 0 without one. Longer ones than ten minutes are refused."""
    time = fields.number(element, "Timeout", default=0)
    if time > TIMEOUT_MAX:
        fields.refuse(element, f"{time} ms; at most {TIMEOUT_MAX} ms", tag="Timeout")
    return time * MILLISECOND


def _transitions(element: Element, fields: Fields) -> tuple[str, ...]:
    found = tuple(each.text.strip() for each in element.all("Transition"))
    for text in found:
        if len(text) != 2 or not set(text) <= set(STATES):
            fields.refuse(element, f"{text!r} is not a transition, such as PS", tag="Transition")
    if not found:
        fields.refuse(element, f"{element.tag} has no Transition")
    return found


def _optional(element: Element, fields: Fields, tag: str) -> int | None:
    return None if element.find(tag) is None else fields.number(element, tag, bits=16)


def read_mailbox_commands(mailbox: Element, fields: Fields) -> tuple[MailboxCommand, ...]:
    """Return the mailbox commands of all protocols, in the order of the file."""
    return tuple(_mailbox_commands(mailbox, fields))


def _mailbox_commands(mailbox: Element, fields: Fields) -> Iterator[MailboxCommand]:
    for protocol in mailbox.all(*PROTOCOLS):
        for commands in protocol.all("InitCmds"):
            for element in commands.all("InitCmd"):
                yield _mailbox_command(protocol.tag, element, fields)


def _mailbox_command(protocol: str, element: Element, fields: Fields) -> MailboxCommand:
    source, comment = fields.source(element), fields.text(element, "Comment")
    transitions = _transitions(element, fields)
    data = fields.data(element, "Data") or b""
    download = None
    if protocol == "CoE":
        if not data and fields.number(element, "Ccs", bits=8, default=1) == DOWNLOAD:
            fields.refuse(element, "a download has no Data")
        download = InitCommand(
            transitions=transitions,
            index=fields.number(element, "Index", bits=16),
            subindex=fields.number(element, "SubIndex", bits=8, default=0),
            data=data,
            complete_access=fields.flag(element, "@CompleteAccess"),
            fixed=fields.flag(element, "@Fixed"),
            comment=comment,
            source=str(source),
        )
    is_soe = protocol == "SoE"
    return MailboxCommand(
        protocol=protocol,
        transitions=transitions,
        data=data,
        download=download,
        operation=fields.number(element, "OpCode" if is_soe else "Ccs", bits=8, default=1),
        idn=fields.number(element, "IDN", bits=16) if is_soe else None,
        elements=fields.number(element, "Elements", bits=8, default=SOE_VALUE) if is_soe else 0,
        drive=fields.number(element, "DriveNo", bits=8, default=0) if is_soe else 0,
        disabled=fields.flag(element, "Disabled"),
        timeout=read_timeout(element, fields),
        comment=comment,
        source=source,
    )
