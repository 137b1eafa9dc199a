"""Start-up lists of TwinCAT as StartUp objects."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.drive import read_start_up
from catenary.errors import MachineFileError
from catenary.esi.eni import read_eni, read_start_up_list
from tests.esi.eni_file import write_eni
from tests.machine.eni_bus import segment_of

HEAD = '<?xml version="1.0" encoding="utf-8"?>\n<EtherCATMailbox>\n<CoE>\n<InitCmds>\n'
TAIL = "</InitCmds>\n</CoE>\n</EtherCATMailbox>\n"


def command(
    index: int, subindex: int, data: str, *, way: str = "PS", attributes: str = "", more: str = ""
) -> str:
    """Return a command as TwinCAT writes it."""
    return (
        f"<InitCmd {attributes}><Transition>{way}</Transition><Comment><![CDATA[a comment]]>"
        f"</Comment><Timeout>0</Timeout><Ccs>1</Ccs><Index>{index}</Index>"
        f"<SubIndex>{subindex}</SubIndex><Data>{data}</Data>{more}</InitCmd>\n"
    )


def write(folder: Path, *commands: str) -> Path:
    path = folder / "drive.xml"
    path.write_text(HEAD + "".join(commands) + TAIL)
    return path


def test_commands_become_start_up_objects_in_their_order(tmp_path: Path) -> None:
    path = write(tmp_path, command(0x8000, 6, "c800"), command(0x60C2, 1, "01", way="IP"))
    assert read_start_up(path) == [
        cat.StartUp(0x8000, 6, b"\xc8\x00", verify=False),
        cat.StartUp(0x60C2, 1, b"\x01", verify=False),
    ]


def test_complete_access_is_kept(tmp_path: Path) -> None:
    path = write(tmp_path, command(0x2000, 1, "1122", attributes='CompleteAccess="true"'))
    [found] = read_start_up(path)
    assert found == cat.StartUp(0x2000, 1, b"\x11\x22", verify=False, complete_access=True)


def test_the_mapping_is_left_out_with_a_warning(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        command(0x8000, 6, "01"),
        command(0x1C12, 0, "01000016", attributes='Fixed="true" CompleteAccess="true"'),
        command(0x8000, 7, "02"),
        command(0x8000, 8, "03", more="<Disabled>1</Disabled>"),
        command(0x8000, 9, "04", way="SP"),
    )
    reasons = r"3 commands are left out: 1 of the PDO mapping \(use pdos=\), 1 disabled, 1 at SP"
    with pytest.warns(RuntimeWarning, match=reasons):
        found = read_start_up(path)
    assert [(each.subindex, each.before_mapping) for each in found] == [(6, True), (7, False)]


@pytest.mark.parametrize(
    ("commands", "message"),
    [
        (command(0x8000, 6, "01", way="SO"), "transition SO is not supported"),
        (command(0x8000, 6, "01").replace("<Ccs>1", "<Ccs>2"), "Ccs 2 is not supported"),
        (command(0x8000, 6, "01", attributes='CompleteAccess="1"'), "subindex 0 or 1"),
        (command(0x8000, 6, "1"), "is not hexadecimal data"),
        (command(0x8000, 600, "01"), "'600' does not fit into 8 bits"),
        ("<InitCmd><Transition>PS</Transition></InitCmd>", "InitCmd"),
    ],
)
def test_other_commands_are_refused_with_the_line(
    tmp_path: Path, commands: str, message: str
) -> None:
    path = write(tmp_path, commands)
    with pytest.raises(MachineFileError, match=message) as caught:
        read_start_up(path)
    assert (caught.value.path, caught.value.line) == (str(path), 5)


def test_soe_is_refused_by_idn(tmp_path: Path) -> None:
    path = tmp_path / "soe.xml"
    path.write_text(
        "<EtherCATMailbox>\n<SoE>\n<InitCmds>\n<InitCmd><Transition>PS</Transition>"
        "<Comment>mode</Comment><Timeout>0</Timeout><OpCode>3</OpCode><DriveNo>1</DriveNo>"
        "<IDN>32800</IDN><Elements>64</Elements><Attribute>0</Attribute><Data>0b00</Data>"
        "</InitCmd></InitCmds></SoE></EtherCATMailbox>"
    )
    with pytest.raises(MachineFileError, match="P-0-0032 of drive 1: SoE is not supported") as e:
        read_start_up(path)
    assert e.value.line == 4
    [found] = read_start_up_list(path)
    assert (found.idn, found.drive, found.elements, found.operation) == (0x8020, 1, 0x40, 3)
    assert (found.data, found.transitions, found.source.line) == (b"\x0b\x00", ("PS",), 4)


def test_another_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MachineFileError, match="root is EtherCATConfig, not EtherCATMailbox"):
        read_start_up(write_eni(tmp_path))


def test_a_list_is_written_to_the_device(tmp_path: Path) -> None:
    segment = segment_of(read_eni(write_eni(tmp_path)))
    path = write(
        tmp_path,
        command(0x2000, 1, "1122", attributes='CompleteAccess="1"'),
        command(0x2100, 0, "07"),
    )
    with cat.MainDevice(segment) as main:
        data = cat.ProcessData(main.scan()[0], start_up=read_start_up(path))
        with cat.Loop(data, period=2e-3):
            assert segment[0].read_object(0x2000, 1) == b"\x11\x22"
            assert segment[0].read_object(0x2100) == b"\x07"
