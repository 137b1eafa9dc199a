"""Telegrams of SERCOS drives → process data of the device (S-0-0015, S-0-0016, S-0-0024).

As in SOEM (ec_soe.c, ecx_readIDNmap), the control word and the status word precede the listed IDNs,
and the telegrams of all drives follow one another. Unlike SOEM, the telegram type is read, and an
error is reported instead of a mapping that is too short.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from catenary.errors import CatenaryError, MailboxError, MappingError, SoeError
from catenary.model.device import DeviceDescription
from catenary.model.sercos_axis import (
    AT_LIST,
    CONFIGURABLE,
    CONTROL_WORD,
    MDT_LIST,
    STATUS_WORD,
    TELEGRAM_TYPE,
    Scaling,
    SercosAxis,
    TelegramValue,
)
from catenary.model.telegram_data import with_process_data
from catenary.procedure.exchange import Procedure
from catenary.procedure.idn_commands import PRE_OP_STEPS, run_idn_commands
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sercos import read_parameter, read_value, write_value
from catenary.procedure.soe import Target
from catenary.wire.sercos import Attribute, idn_number, idn_text
from catenary.wire.soe import DRIVES, Element

ENTRIES_MAX = 64  # IDNs in a telegram; SOEM accepts as many (EC_SOE_MAXMAPPING)
WORD = Attribute(2)
# Telegram types 0 to 6 of S-0-0015: IDNs of MDT and AT
STANDARD: Mapping[int, tuple[tuple[int, ...], tuple[int, ...]]] = {
    0: ((), ()),
    1: ((80,), ()),
    2: ((36,), (40,)),
    3: ((36,), (51,)),
    4: ((47,), (51,)),
    5: ((47, 36), (51, 40)),
    6: ((36,), ()),
}
# Type, factor, exponent, polarity, resolution
POSITION, VELOCITY, TORQUE = (76, 77, 78, 55, 79), (44, 45, 46, 43, 0), (86, 93, 94, 85, 0)


def with_telegrams(
    channel: MailboxChannel, device: DeviceDescription
) -> Procedure[DeviceDescription]:
    """Return the description with the process data that the telegrams of its drives specify.

    An error becomes a note of the description, which then has no process data.

    Args:
        channel: The mailbox of the device.
        device: The description without process data.
    """
    try:
        yield from write_telegrams(channel, device)
        axes = yield from read_axes(channel)
    except CatenaryError as error:
        note = f"no process data, because its telegrams cannot be read: {error.message}"
        return replace(device, notes=(*device.notes, note))
    return with_process_data(device, axes)


def write_telegrams(channel: MailboxChannel, device: DeviceDescription) -> Procedure[None]:
    """Write the telegrams that the ESI or ENI of a device requires, before they are read."""
    own = (TELEGRAM_TYPE, MDT_LIST, AT_LIST)
    chosen = [each for each in device.idn_commands if each.number in own]
    yield from run_idn_commands(channel, chosen, PRE_OP_STEPS)


def configure(
    channel: MailboxChannel,
    device: DeviceDescription,
    drive: int,
    mdt: Sequence[int] | None,
    at: Sequence[int] | None,
) -> Procedure[DeviceDescription]:
    """Write the telegrams of a drive, and return the description with its new process data.

    Args:
        channel: The mailbox of the device, in PRE-OP.
        device: Its description.
        drive: Number of the drive.
        mdt: IDNs of the outputs after S-0-0134; None: unchanged.
        at: IDNs of the inputs after S-0-0135; None: unchanged.

    Raises:
        SoeError: The drive refuses a list, for example because an IDN cannot be in it.
        MailboxError: The device violates the protocol.
        ResponseTimeout: The device does not answer.
    """
    yield from write_value(Target(channel, TELEGRAM_TYPE, drive), CONFIGURABLE)
    for number, idns in ((MDT_LIST, mdt), (AT_LIST, at)):
        if idns is not None:
            yield from write_value(
                Target(channel, number, drive), [idn_text(each) for each in idns]
            )
    axes = yield from read_axes(channel)
    return with_process_data(device, axes)


def restore(channel: MailboxChannel, device: DeviceDescription) -> Procedure[None]:
    """Write the telegrams of a device that has others, such as one that returned.

    Args:
        channel: The mailbox of the device, in PRE-OP.
        device: Its description with the telegrams to write.

    Raises:
        MappingError: It does not accept them.
    """
    present = yield from read_axes(channel, scaling=False)
    lists = {each.drive: (each.outputs, each.inputs) for each in present}
    for axis in device.sercos_axes:
        if lists.get(axis.drive) == (axis.outputs, axis.inputs):
            continue
        if axis.is_configurable:
            mdt = [each.number for each in axis.outputs[1:]]
            at = [each.number for each in axis.inputs[1:]]
            yield from configure(channel, device, axis.drive, mdt, at)
        elif axis.telegram_type is not None:
            yield from write_value(Target(channel, TELEGRAM_TYPE, axis.drive), axis.telegram_type)
    yield from check_unchanged(channel, device)


def check_unchanged(channel: MailboxChannel, device: DeviceDescription) -> Procedure[None]:
    """Raise MappingError if the telegrams of a device differ from its description.

    Args:
        channel: The mailbox of the device.
        device: Its description.
    """
    axes = yield from read_axes(channel, scaling=False)
    expected = [(each.drive, each.outputs, each.inputs) for each in device.sercos_axes]
    if [(each.drive, each.outputs, each.inputs) for each in axes] != expected:
        raise MappingError(
            f"{channel.station}: its telegrams (S-0-0015, S-0-0016, S-0-0024) have changed since "
            "the scan",
            hint="scan again after a change, or change them with sub.soe.configure_telegrams()",
        )


def read_axes(channel: MailboxChannel, *, scaling: bool = True) -> Procedure[list[SercosAxis]]:
    """Read telegrams and scaling of the drives. The first drive that does not answer is the end.

    Args:
        channel: The mailbox of the device.
        scaling: True to read the scaling, too.

    Raises:
        SoeError: Drive 0 has no telegrams, or a listed IDN does not exist.
        MailboxError: A list is not valid.
        ResponseTimeout: The device does not answer.
    """
    axes: list[SercosAxis] = []
    out_bit = in_bit = 0
    for drive in DRIVES:
        lists = yield from _lists(channel, drive)
        if lists is None:
            break
        kind, mdt, at = lists
        outputs = yield from read_values(channel, drive, CONTROL_WORD, mdt, out_bit)
        inputs = yield from read_values(channel, drive, STATUS_WORD, at, in_bit)
        out_bit = outputs[-1].bit_offset + outputs[-1].bit_length
        in_bit = inputs[-1].bit_offset + inputs[-1].bit_length
        axis = SercosAxis(drive, kind, outputs, inputs)
        axes.append((yield from _with_scaling(channel, axis)) if scaling else axis)
    return axes


def with_lists(
    channel: MailboxChannel,
    axes: Sequence[SercosAxis],
    wanted: Mapping[int, tuple[Sequence[int], Sequence[int]]],
) -> Procedure[list[SercosAxis]]:
    """Return the drives as they are with other telegrams. Only attributes are read.

    Args:
        channel: The mailbox of the device.
        axes: The drives with their present telegrams.
        wanted: IDNs of MDT and AT by the number of the drive. Other drives keep theirs.

    Raises:
        SoeError: A drive does not have an IDN.
        MailboxError: An IDN is a list, or the device violates the protocol.
        ResponseTimeout: The device does not answer.
    """
    found: list[SercosAxis] = []
    out_bit = in_bit = 0
    for axis in axes:
        mdt = [each.number for each in axis.outputs[1:]]
        at = [each.number for each in axis.inputs[1:]]
        kind = CONFIGURABLE if axis.drive in wanted else axis.telegram_type
        mdt, at = map(list, wanted.get(axis.drive, (mdt, at)))
        outputs = yield from read_values(channel, axis.drive, CONTROL_WORD, mdt, out_bit)
        inputs = yield from read_values(channel, axis.drive, STATUS_WORD, at, in_bit)
        out_bit = outputs[-1].bit_offset + outputs[-1].bit_length
        in_bit = inputs[-1].bit_offset + inputs[-1].bit_length
        found.append(replace(axis, telegram_type=kind, outputs=outputs, inputs=inputs))
    return found


def _lists(
    channel: MailboxChannel, drive: int
) -> Procedure[tuple[int | None, Sequence[int], Sequence[int]] | None]:
    """Return telegram type, MDT and AT of a drive; None if the device has no such drive."""
    kind = yield from _number(Target(channel, TELEGRAM_TYPE, drive))
    standard = STANDARD.get(kind & CONFIGURABLE) if kind is not None else None
    if standard is not None:
        return kind, *standard
    try:
        mdt = yield from _idns(Target(channel, MDT_LIST, drive))
        at = yield from _idns(Target(channel, AT_LIST, drive))
    except SoeError:
        if drive:
            return None
        raise
    return kind, mdt, at


def _idns(target: Target) -> Procedure[list[int]]:
    value = yield from read_value(target)
    if not isinstance(value, list) or len(value) > ENTRIES_MAX:
        raise MailboxError(
            f"{target}: not a list of at most {ENTRIES_MAX} IDNs", hint="its firmware is at fault"
        )
    return [idn_number(each) for each in value if isinstance(each, (str, int))]


def _number(target: Target) -> Procedure[int | None]:
    """Return the value of an IDN as an integer; None if the drive does not have it."""
    try:
        value = yield from read_value(target)
    except SoeError:
        return None
    return int(value) if isinstance(value, (int, float)) else None


def read_values(
    channel: MailboxChannel, drive: int, word: int, idns: Sequence[int], bit: int
) -> Procedure[tuple[TelegramValue, ...]]:
    """Read the attributes of the values of a telegram, and return them with their places.

    Args:
        channel: The mailbox of the device.
        drive: Number of the drive.
        word: IDN of the first value, S-0-0134 or S-0-0135.
        idns: IDNs of the other values.
        bit: Place of the first value.

    Raises:
        SoeError: The drive does not have an IDN.
        MailboxError: An IDN is a list, or the device violates the protocol.
        ResponseTimeout: The device does not answer.
    """
    values = [TelegramValue(word, bit, WORD)]
    for number in idns:
        bit += values[-1].bit_length
        target = Target(channel, number, drive)
        found = yield from read_parameter(target, Element.ATTRIBUTE | Element.UNIT)
        if found.attribute.is_list:
            raise MailboxError(
                f"{target} is a list: a telegram cannot contain it",
                hint="remove it from S-0-0016 or S-0-0024",
            )
        values.append(TelegramValue(number, bit, found.attribute, found.unit))
    return tuple(values)


def _with_scaling(channel: MailboxChannel, axis: SercosAxis) -> Procedure[SercosAxis]:
    found: list[Scaling] = []
    for idns in (POSITION, VELOCITY, TORQUE):
        numbers: list[int | None] = []
        for number in idns:
            target = Target(channel, number, axis.drive)
            numbers.append((yield from _number(target)) if number else None)
        found.append(Scaling(*numbers))
    position, velocity, torque = found
    return replace(axis, position=position, velocity=velocity, torque=torque)
