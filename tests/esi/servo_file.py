"""ESI file of the virtual servo: its PDOs, modes and commands, with changes for a test."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from catenary.virtual import Coupler, Segment, Servo
from catenary.virtual.description import VENDOR_ID

PRODUCT = 0x0005_0001

RX = ((0x6040, 16, "UINT"), (0x6060, 8, "SINT"), (0x60FF, 32, "DINT"), (0x607A, 32, "DINT"))
TX = ((0x6041, 16, "UINT"), (0x6061, 8, "SINT"), (0x606C, 32, "DINT"), (0x6064, 32, "DINT"))
MODES = """
        <OpMode><Name>Synchron</Name><Desc>SM-Synchron</Desc>
          <AssignActivate>#x0</AssignActivate></OpMode>
        <OpMode><Name>DC</Name><Desc>DC-Synchron</Desc>
          <AssignActivate>#x300</AssignActivate>
          <CycleTimeSync0 Factor="1">0</CycleTimeSync0></OpMode>"""


PROFILE = """<Profile><ProfileNo>402</ProfileNo><Dictionary>
  <DataTypes>
    <DataType><Name>MODE</Name><BaseType>SINT</BaseType><BitSize>8</BitSize>
      <EnumInfo><Text>CSP</Text><Enum>8</Enum></EnumInfo></DataType>
    <DataType><Name>SINT</Name><BitSize>8</BitSize></DataType>
    <DataType><Name>UDINT</Name><BitSize>32</BitSize></DataType>
  </DataTypes>
  <Objects>
    <Object><Index>#x6060</Index><Name>Mode</Name><Type>MODE</Type><BitSize>8</BitSize>
      <Flags><Access>rw</Access><PdoMapping>R</PdoMapping></Flags></Object>
    <Object><Index>#x6065</Index><Name>Window</Name><Type>UDINT</Type><BitSize>32</BitSize>
      <Flags><Access>rw</Access></Flags></Object>
  </Objects></Dictionary></Profile>"""


def segment(**options: object) -> Segment:
    return Segment([Coupler(), Servo(**options)])  # type: ignore[arg-type]


def revision() -> int:
    return Servo().description().revision


def pdo(
    tag: str,
    index: int,
    name: str,
    entries: Sequence[tuple[int, int, str]],
    attributes: str = "",
    rules: str = "",
) -> str:
    """Return a PDO. `attributes` is text such as 'Sm="2"', `rules` elements such as Exclude."""
    inner = "".join(
        f"<Entry><Index>#x{i:x}</Index><SubIndex>0</SubIndex><BitLen>{bits}</BitLen>"
        f"<Name>ESI {i:x}</Name><DataType>{kind}</DataType></Entry>"
        for i, bits, kind in entries
    )
    return f"""
        <{tag} {attributes}><Index>#x{index:x}</Index><Name>{name}</Name>{rules}{inner}</{tag}>"""


def command(index: int, data: str, transition: str = "PS", attributes: str = "") -> str:
    """Return an InitCmd of subindex 0."""
    return f"""
          <InitCmd {attributes}><Transition>{transition}</Transition>
            <Index>#x{index:x}</Index><SubIndex>0</SubIndex><Data>{data}</Data>
            <Comment>from the ESI</Comment></InitCmd>"""


def choices() -> str:
    """Return PDOs with one more, which cannot be assigned together with the inputs."""
    exclude = "<Exclude>#x1a00</Exclude>"
    return PDOS + pdo("TxPdo", 0x1A01, "Inputs short", TX[:1], "", exclude)


PDOS = pdo("RxPdo", 0x1600, "Outputs", RX, 'Sm="2"') + pdo("TxPdo", 0x1A00, "Inputs", TX, 'Sm="3"')


def text(
    *,
    pdos: str = PDOS,
    commands: str = "",
    modes: str = MODES,
    info: str = "",
    profile: str = "",
    number: int | None = None,
    check: str = "",
    product: int = PRODUCT,
    vendor: int = VENDOR_ID,
) -> str:
    """Return the file. Each option is the content of one element."""
    known = revision() if number is None else number
    return f"""<?xml version="1.0" encoding="utf-8"?>
<EtherCATInfo>
  <Vendor><Id>#x{vendor:x}</Id><Name>Catenary</Name></Vendor>
  <Descriptions><Groups><Group><Type>G</Type><Name>Drives</Name></Group></Groups>
    <Devices><Device Physics="YY">
        <Type ProductCode="#x{product:x}" RevisionNo="#x{known:x}" {check}>SERVO</Type>
        <Name>Servo of the ESI</Name>
        <Info>{info}</Info>
        <GroupType>G</GroupType>{profile}
        <Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu>{pdos}
        <Mailbox><CoE SdoInfo="1" PdoAssign="1" PdoConfig="1">{commands}
        </CoE></Mailbox>
        <Dc>{modes}
        </Dc>
      </Device></Devices>
  </Descriptions>
</EtherCATInfo>
"""


def write(folder: Path, name: str = "servo.xml", **options: object) -> Path:
    """Write the file into a folder, and return its path."""
    path = folder / name
    path.write_text(text(**options), encoding="utf-8")  # type: ignore[arg-type]
    return path


def line_of(path: Path, fragment: str) -> str:
    """Return "FILE:LINE" of the first line with a fragment."""
    lines = path.read_text(encoding="utf-8").splitlines()
    number = next(k for k, line in enumerate(lines, 1) if fragment in line)
    return f"{path}:{number}"
