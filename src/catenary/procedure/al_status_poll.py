"""AL status of all devices, read in shared frames, ETG.1000.4 §6.1, §6.4.

Unlike in `al_state.read_state`, a missing reply is not an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from catenary.procedure.exchange import Procedure, read_memory
from catenary.procedure.station import Station
from catenary.wire.register import AL_STATUS, AL_STATUS_CODE

_START = AL_STATUS.address
_SIZE = AL_STATUS_CODE.address + AL_STATUS_CODE.size - _START


class Answer(NamedTuple):
    """The answer of one device. `word` is None if it did not answer."""

    station: Station
    word: int | None  # AL status
    code: int = 0  # AL status code


def survey(stations: Sequence[Station]) -> Procedure[list[Answer]]:
    """Read the AL status of all devices. `word` is None for a device that did not answer."""
    replies = yield [
        read_memory(station.address, _START, _SIZE, repeatable=True) for station in stations
    ]
    answers = []
    for station, reply in zip(stations, replies, strict=True):
        if reply.lost or reply.working_counter == 0:
            answers.append(Answer(station, None))
            continue
        word = AL_STATUS.unpack(reply.data[: AL_STATUS.size])
        code = AL_STATUS_CODE.unpack(reply.data[-AL_STATUS_CODE.size :])
        answers.append(Answer(station, word, code))
    return answers
