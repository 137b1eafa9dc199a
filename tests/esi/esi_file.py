"""ESI files of the tests: text of devices and of whole files."""

from __future__ import annotations

from pathlib import Path

VENDOR = 0x5A5A


def device(
    product: int = 1,
    revision: int = 1,
    *,
    type: str = "DRIVE-1",
    name: str = "Drive",
    attributes: str = "",
    inner: str = "",
    entry: str = "Value",
) -> str:
    """Return a device with one TxPDO."""
    return f"""
      <Device Physics="YY">
        <Type ProductCode="#x{product:x}" RevisionNo="#x{revision:x}" {attributes}>{type}</Type>
        {inner if inner.startswith("<HideType") else ""}
        <Name LcId="1031">Antrieb</Name><Name LcId="1033">{name}</Name>
        <GroupType>G</GroupType>
        {"" if inner.startswith("<HideType") else inner}
        <Fmmu>Inputs</Fmmu>
        <Sm StartAddress="#x1000" ControlByte="#x20" Enable="1">Inputs</Sm>
        <TxPdo Fixed="1" Sm="0"><Index>#x1a00</Index><Name>In</Name>
          <Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen>
            <Name>{entry}</Name><DataType>INT</DataType></Entry>
        </TxPdo>
      </Device>"""


def module(ident: int, type: str = "M") -> str:
    """Return a module with one TxPDO."""
    return f"""<Module><Type ModuleIdent="#x{ident:x}">{type}</Type><Name>Module {type}</Name>
        <TxPdo Sm="0"><Index>#x1a01</Index><Name>M</Name></TxPdo></Module>"""


def esi(*devices: str, modules: str = "", reference: str = "", vendor: int = VENDOR) -> str:
    """Return the text of an ESI file."""
    listed = f"<Modules>{modules}</Modules>" if modules else ""
    return f"""<?xml version="1.0" encoding="utf-8"?>
<EtherCATInfo>{reference}
  <Vendor><Id>#x{vendor:x}</Id><Name>Acme</Name></Vendor>
  <Descriptions>
    <Groups><Group><Type>G</Type><Name>Drives</Name></Group></Groups>
    <Devices>{"".join(devices)}
    </Devices>{listed}
  </Descriptions>
</EtherCATInfo>
"""


def write(path: Path, *devices: str, **options: str) -> Path:
    """Write an ESI file, and return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(esi(*devices, **options), encoding="utf-8")  # type: ignore[arg-type]
    return path
