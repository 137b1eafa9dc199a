"""ENI of terminals without a mailbox: bits of one byte, several devices, own variables."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.esi.eni import read_eni
from tests.machine.eni_bus import segment_of

OP = 8


def slave(name: str, number: int, product: int, process_data: str) -> str:
    return (
        f"<Slave><Info><Name>{name}</Name><PhysAddr>{1001 + number}</PhysAddr>"
        f"<AutoIncAddr>{-number & 0xFFFF}</AutoIncAddr><Physics>KK</Physics><VendorId>2</VendorId>"
        f"<ProductCode>{product}</ProductCode><RevisionNo>1</RevisionNo></Info>{process_data}"
        f"</Slave>\n"
    )


def pdo(tag: str, index: int, manager: int, name: str, place: int) -> str:
    return (
        f'<{tag} Fixed="1" Sm="{manager}"><Index>#x{index:x}</Index><Name>{name}</Name><Entry>'
        f"<Index>#x{place:x}</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><Name>Value</Name>"
        f"<DataType>BOOL</DataType></Entry></{tag}>"
    )


def terminal(tag: str, start: int, area: str, kind: str, first: int, place: int) -> str:
    """Return process data of four bits, which begin at a bit of the image."""
    pdos = "".join(pdo(tag, first + k, 0, f"Channel {k + 1}", place + 0x10 * k) for k in range(4))
    numbers = "".join(f"<Pdo>{first + k}</Pdo>" for k in range(4))
    memory, control = (0x0F00, 0x44) if kind == "Outputs" else (0x1000, 0x00)
    return (
        f"<ProcessData><{area}><BitStart>{start}</BitStart><BitLength>4</BitLength></{area}>"
        f"<Sm0><Type>{kind}</Type><StartAddress>{memory}</StartAddress>"
        f"<ControlByte>{control}</ControlByte><Enable>1</Enable>{numbers}</Sm0>{pdos}</ProcessData>"
    )


def variable(name: str, bit: int, bits: int = 1) -> str:
    return (
        f"<Variable><Name>{name}</Name><DataType>BOOL</DataType><BitSize>{bits}</BitSize>"
        f"<BitOffs>{bit}</BitOffs></Variable>"
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    text = "<EtherCATConfig><Config>"
    text += slave("Term 1", 0, 0x1000, "")
    text += slave("Term 2", 1, 0x1001, terminal("RxPdo", 8, "Send", "Outputs", 0x1600, 0x7000))
    text += slave("Term 2", 2, 0x1001, terminal("RxPdo", 12, "Send", "Outputs", 0x1600, 0x7000))
    text += slave("Term 4", 3, 0x1002, terminal("TxPdo", 3, "Recv", "Inputs", 0x1A00, 0x6000))
    text += "<Cyclic><CycleTime>1000</CycleTime></Cyclic><ProcessImage><Inputs>"
    text += "".join(variable(f"Term 4.Channel {k + 1}.Value", 3 + k) for k in range(4))
    text += variable("Term 4.WcState.WcState", 100) + "</Inputs><Outputs>"
    text += "".join(variable(f"Term 2.Channel {k + 1}.Value", 8 + k) for k in range(4))
    text += "".join(variable(f"Term 3.Channel {k + 1}.Value", 12 + k) for k in range(4))
    text += "</Outputs></ProcessImage></Config></EtherCATConfig>"
    path = tmp_path / "bus.xml"
    path.write_text(text)
    return path


def test_bits_of_terminals_have_the_names_of_the_file(path: Path) -> None:
    segment = segment_of(read_eni(path))
    with cat.Machine(path, target=segment) as machine:
        assert list(machine.process_data) == ["Term 2 1", "Term 2 2", "Term 4"]
        assert list(machine.subs) == ["Term 1", "Term 2 1", "Term 2 2", "Term 4"]
        assert list(machine.variables.left_out) == ["Term 4.WcState.WcState"]
        with machine.loop() as loop:
            machine.variables["Term 2.Channel 1.Value"] = True
            machine.variables["Term 3.Channel 4.Value"] = True
            segment[3].write_object(0x6010, 1, b"\x01")
            for _ in range(5):
                next(loop)
            assert [device.state for device in segment] == [OP] * 4
            found = [segment[k].read_object(0x7000 + 0x10 * n, 1) for k in (1, 2) for n in range(4)]
            assert found == [b"\x01", *[b"\x00"] * 6, b"\x01"]
            inputs = [machine.variables[f"Term 4.Channel {k + 1}.Value"] for k in range(4)]
            assert inputs == [False, True, False, False]
    assert machine.main.is_open is False
