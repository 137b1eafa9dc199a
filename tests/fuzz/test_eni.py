"""Random changes of an ENI: it is read and planned, or raises the documented error."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from catenary.errors import MachineFileError
from catenary.esi.eni import read_eni, read_start_up_list
from catenary.esi.eni.checks import check_commands
from catenary.esi.eni.clocks import sync_signals
from catenary.esi.eni.own_registers import left_out
from catenary.esi.eni.places import place_variables
from catenary.esi.eni.settings import checked_words, watchdog_of
from catenary.machine.eni.text import eni_text
from tests.esi.eni_file import ENI

TEXTS = [
    "",
    "0",
    "-1",
    "#xFFFFFFFFFFFF",
    "65535",
    "abc",
    "00",
    "e8",
    "IP",
    "<a>",
    "&lt;",
    "\0",
    "é",
]
POSITIONS = [k for k, letter in enumerate(ENI) if letter == ">"]
MANY = settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])


@st.composite
def changed(draw: st.DrawFn) -> bytes:
    """Return the file with some texts after a tag replaced, and perhaps a part removed."""
    text = ENI
    for place in sorted(draw(st.lists(st.sampled_from(POSITIONS), max_size=4)), reverse=True):
        end = text.find("<", place)
        if end >= 0:
            text = text[: place + 1] + draw(st.sampled_from(TEXTS)) + text[end:]
    if draw(st.booleans()):
        text = text.replace("EtherCATConfig", "EncryptedEtherCATConfig")
    data = text.encode()
    if draw(st.booleans()):
        start = draw(st.integers(0, len(data)))
        data = data[:start] + draw(st.binary(max_size=4)) + data[start + draw(st.integers(0, 40)) :]
    return data


def use(path: Path) -> None:
    """Read a file and use all of its content."""
    eni = read_eni(path)
    place_variables(eni)
    left_out(eni)
    for device in eni.devices:
        sync_signals(device)
        watchdog_of(device)
        checked_words(device.commands)
    eni_text(eni)
    check_commands(eni)


@MANY
@given(changed())
def test_a_changed_file_is_read_or_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "bus.xml"
    path.write_bytes(data)
    with suppress(MachineFileError):
        use(path)


@MANY
@given(st.binary(max_size=300))
def test_random_bytes_are_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "bus.xml"
    path.write_bytes(data)
    for read in (read_eni, read_start_up_list):
        with pytest.raises(MachineFileError):
            read(path)
