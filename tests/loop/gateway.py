"""ESI of a gateway with slots for terminals, as a file, and a virtual gateway from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import catenary as cat
from catenary.virtual import DescribedDevice, Segment, from_esi

DI, DO, AI = 0x11, 0x22, 0x33
FILE = "gateway.xml"


def entry(index: int, subindex: int, bits: int, kind: str, name: str) -> str:
    return f"""<Entry><Index DependOnSlot="1">#x{index:x}</Index><SubIndex>{subindex}</SubIndex>
      <BitLen>{bits}</BitLen><Name>{name}</Name><DataType>{kind}</DataType></Entry>"""


def terminal(ident: int, kind: str, pdo: str, index: int, entries: str) -> str:
    return f"""<Module><Type ModuleIdent="#x{ident:x}">{kind}</Type><Name>Terminal {kind}</Name>
      <{pdo}Pdo Fixed="1" Mandatory="1"><Index DependOnSlot="1">#x{index:x}</Index>
        <Name>{kind}</Name>{entries}</{pdo}Pdo>
      <Mailbox><CoE><InitCmd><Transition>PS</Transition><Index DependOnSlot="1">#x8000</Index>
        <SubIndex>1</SubIndex><Data>07</Data><Comment>filter</Comment></InitCmd></CoE></Mailbox>
      <Profile><Dictionary>
        <DataTypes>
          <DataType><Name>USINT</Name><BitSize>8</BitSize></DataType>
          <DataType><Name>DT8000</Name><BitSize>24</BitSize>
            <SubItem><SubIdx>0</SubIdx><Name>Count</Name><Type>USINT</Type><BitSize>8</BitSize>
              <BitOffs>0</BitOffs></SubItem>
            <SubItem><SubIdx>1</SubIdx><Name>Filter</Name><Type>USINT</Type><BitSize>8</BitSize>
              <BitOffs>16</BitOffs><Flags><Access>rw</Access></Flags></SubItem></DataType>
        </DataTypes>
        <Objects><Object><Index DependOnSlot="1">#x8000</Index><Name>Settings</Name>
          <Type>DT8000</Type><BitSize>24</BitSize></Object></Objects></Dictionary></Profile>
    </Module>"""


TERMINALS = (
    terminal(DI, "8 DI", "Tx", 0x1A00, entry(0x6000, 1, 8, "USINT", "Inputs")),
    terminal(DO, "8 DO", "Rx", 0x1600, entry(0x7000, 1, 8, "USINT", "Outputs")),
    terminal(
        AI,
        "2 AI",
        "Tx",
        0x1A00,
        entry(0x6000, 1, 16, "INT", "Value 1") + entry(0x6000, 2, 16, "INT", "Value 2"),
    ),
)


def text(attributes: str = "") -> str:
    """Return the ESI. `attributes` are those of `Slots`."""
    accepted = "".join(f"<ModuleIdent>#x{ident:x}</ModuleIdent>" for ident in (DI, DO, AI))
    return f"""<?xml version="1.0" encoding="utf-8"?>
<EtherCATInfo><Vendor><Id>#x5a5a</Id><Name>Acme</Name></Vendor><Descriptions>
  <Devices><Device Physics="YY"><Type ProductCode="#x9" RevisionNo="#x1">GATE-1</Type>
    <Name>Gateway</Name>
    <Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu><Fmmu>MBoxState</Fmmu>
    <Sm DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
    <Sm DefaultSize="128" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>
    <Sm StartAddress="#x1100" ControlByte="#x24" Enable="1">Outputs</Sm>
    <Sm StartAddress="#x1400" ControlByte="#x20" Enable="1">Inputs</Sm>
    <TxPdo Fixed="1" Sm="3"><Index>#x1aff</Index><Name>Gateway</Name>
      <Entry><Index>#xf100</Index><SubIndex>1</SubIndex><BitLen>8</BitLen><Name>State</Name>
        <DataType>USINT</DataType></Entry></TxPdo>
    <Mailbox><CoE SdoInfo="1" PdoAssign="1"/></Mailbox>
    <Slots SlotPdoIncrement="1" SlotIndexIncrement="#x10" {attributes}>
      <Slot MinInstances="0" MaxInstances="4"><Name>Terminal</Name>{accepted}</Slot>
    </Slots>
  </Device></Devices><Modules>{"".join(TERMINALS)}</Modules></Descriptions></EtherCATInfo>"""


@contextmanager
def gateway(
    folder: Path, modules: Sequence[str | int | None], attributes: str = ""
) -> Iterator[tuple[cat.MainDevice, cat.SubDevice, DescribedDevice]]:
    """Open a segment with a virtual gateway, and scan it with its ESI.

    Args:
        folder: Folder for the ESI.
        modules: Terminals in its slots.
        attributes: Attributes of `Slots`.
    """
    path = folder / FILE
    path.write_text(text(attributes))
    model = from_esi(path, modules=modules)
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan(esi=path)
        yield main, sub, model
