"""Synchronisation types of a device, 0x1C32:01 and 0x1C33:01.

They are read before a loop with clocks and restored after it. Otherwise the device would also wait
for SYNC0 in the next program.
"""

from __future__ import annotations

from collections.abc import Mapping

from catenary.errors import CatenaryError, StateError
from catenary.igh.describe import read_if_there
from catenary.igh.reservation import Reservation
from catenary.plan.clocks import SYNC_OBJECTS
from catenary.procedure.al_state import DeviceState
from catenary.wire.al import AlState


def read_types(master: Reservation, position: int) -> dict[int, bytes]:
    """Return the synchronisation types of a device, by index of the object.

    Args:
        master: The reserved master.
        position: The position of the device.
    """
    found = {index: read_if_there(master, position, index, 1) for index in SYNC_OBJECTS}
    return {index: kind for index, kind in found.items() if kind}


def write_types(
    master: Reservation, position: int, types: Mapping[int, bytes], state: DeviceState
) -> None:
    """Restore the types that differ from the present ones. The device must be in PRE-OP.

    Args:
        master: The reserved master.
        position: The present position of the device.
        types: The types by index, from `read_types`.
        state: The present state of the device.

    Raises:
        StateError: The device is in another state, in which it would refuse the types.
        CatenaryError: It refuses them, or does not answer.
    """
    if state.state is not AlState.PRE_OP or state.error:
        raise StateError(
            f"device {position} is not in PRE-OP but in {state.state or 'an unknown state'}: "
            f"{_named(types)} cannot be restored, and it keeps waiting for SYNC0",
            position=position,
            requested=int(AlState.PRE_OP),
            actual=state.word,
            code=state.code,
            hint=_by_hand(position, types),
        )
    for index, kind in types.items():
        if read_if_there(master, position, index, 1) == kind:
            continue
        try:
            master.download(position, index, 1, kind)
        except CatenaryError as error:
            error.hint = _by_hand(position, {index: kind})
            raise


def _named(types: Mapping[int, bytes]) -> str:
    return " and ".join(f"0x{index:04X}:01" for index in types)


def _by_hand(position: int, types: Mapping[int, bytes]) -> str:
    values = {index: int.from_bytes(kind, "little") for index, kind in types.items()}
    commands = "; ".join(
        f"ethercat download -p {position} -t uint16 0x{index:04X} 1 {value}"
        for index, value in values.items()
    )
    return f"a loop without clocks will not start; switch the device off and on, or run {commands}"
