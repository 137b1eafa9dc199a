"""native/ethercat.h has the numbers of `wire`."""

import re
from pathlib import Path

from catenary.wire import al, datagram, frame
from catenary.wire.datagram import EcatCommand

HEADER = Path(__file__).resolve().parents[2] / "src" / "catenary" / "native" / "ethercat.h"


def test_the_header_has_the_numbers_of_wire() -> None:
    found = re.findall(r"^ +CAT_(\w+) = (\w+)", HEADER.read_text(), re.MULTILINE)
    assert {name: int(value, 0) for name, value in found} == {
        **{command.name: command.value for command in EcatCommand},
        "ETHERNET_HEADER": frame.ETHERNET_HEADER_SIZE,
        "ETHERCAT_HEADER": frame.ETHERCAT_HEADER_SIZE,
        "DATAGRAM_HEADER": datagram.HEADER_SIZE,
        "DATAGRAM_COUNTER": datagram.OVERHEAD - datagram.HEADER_SIZE,
        "AL_STATE": al.STATE_MASK,
        "AL_ERROR": al.ERROR_FLAG,
        "AL_OP": al.AlState.OP,
    }
