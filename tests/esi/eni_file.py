"""A small ENI: one drive with CoE, clocks and commands of the vendor. Parts can be replaced."""

from __future__ import annotations

from pathlib import Path

ENI = """\
<?xml version="1.0"?>
<EtherCATConfig Version="1.3">
 <Config>
  <Master>
   <Info><Name>Main</Name><Destination>ffffffffffff</Destination></Info>
   <InitCmds>
    <InitCmd>
     <Transition>IP</Transition><BeforeSlave>1</BeforeSlave>
     <Cmd>7</Cmd><Adp>0</Adp><Ado>304</Ado><Data>0000</Data><Retries>0</Retries>
    </InitCmd>
   </InitCmds>
  </Master>
  <Slave>
   <Info>
    <Name>Drive</Name><PhysAddr>1001</PhysAddr><AutoIncAddr>0</AutoIncAddr><Physics>YY</Physics>
    <VendorId>#x9a</VendorId><ProductCode>198948</ProductCode><RevisionNo>66592</RevisionNo>
    <SerialNo>0</SerialNo>
   </Info>
   <ProcessData>
    <Send><BitStart>0</BitStart><BitLength>48</BitLength></Send>
    <Recv><BitStart>16</BitStart><BitLength>48</BitLength></Recv>
    <Sm2>
     <Type>Outputs</Type><StartAddress>4352</StartAddress><ControlByte>100</ControlByte>
     <Enable>1</Enable><Pdo>5632</Pdo>
    </Sm2>
    <Sm3>
     <Type>Inputs</Type><StartAddress>5120</StartAddress><ControlByte>32</ControlByte>
     <Enable>1</Enable><Pdo>6656</Pdo>
    </Sm3>
    <RxPdo Sm="2">
     <Index>#x1600</Index><Name>Outputs</Name>
     <Entry><Index>#x6040</Index><SubIndex>0</SubIndex><BitLen>16</BitLen><Name>Control word</Name>
      <DataType>UINT</DataType></Entry>
     <Entry><Index>#x607a</Index><SubIndex>0</SubIndex><BitLen>32</BitLen><Name>Target</Name>
      <DataType>DINT</DataType></Entry>
    </RxPdo>
    <TxPdo Sm="3">
     <Index>#x1a00</Index><Name>Inputs</Name>
     <Entry><Index>#x6041</Index><SubIndex>0</SubIndex><BitLen>16</BitLen><Name>Status word</Name>
      <DataType>UINT</DataType></Entry>
     <Entry><Index>#x6064</Index><SubIndex>0</SubIndex><BitLen>32</BitLen><Name>Position</Name>
      <DataType>DINT</DataType></Entry>
    </TxPdo>
   </ProcessData>
   <Mailbox>
    <Send><Start>4096</Start><Length>128</Length></Send>
    <Recv><Start>4224</Start><Length>128</Length></Recv>
    <Protocol>CoE</Protocol>
    <CoE>
     <InitCmds>
      <InitCmd CompleteAccess="1">
       <Transition>PS</Transition><Comment>ramp</Comment><Timeout>0</Timeout><Ccs>1</Ccs>
       <Index>8192</Index><SubIndex>1</SubIndex><Data>1122</Data>
      </InitCmd>
      <InitCmd>
       <Transition>SO</Transition><Comment>late</Comment><Timeout>0</Timeout><Ccs>1</Ccs>
       <Index>8448</Index><SubIndex>0</SubIndex><Data>05</Data>
      </InitCmd>
     </InitCmds>
    </CoE>
   </Mailbox>
   <InitCmds>
    <InitCmd>
     <Transition>IP</Transition><Comment>PDI watchdog</Comment><Cmd>5</Cmd><Adp>1001</Adp>
     <Ado>1040</Ado><Data>ea03</Data><Cnt>1</Cnt><Retries>3</Retries>
    </InitCmd>
    <InitCmd>
     <Transition>PS</Transition><Comment>check PDI watchdog</Comment><Cmd>1</Cmd><Adp>0</Adp>
     <Ado>1040</Ado><Data>0000</Data><Cnt>1</Cnt><Retries>3</Retries>
     <Validate><Data>e003</Data><DataMask>f0ff</DataMask><Timeout>100</Timeout></Validate>
    </InitCmd>
    <InitCmd>
     <Transition>PS</Transition><Comment>set DC cycle time</Comment><Cmd>5</Cmd><Adp>1001</Adp>
     <Ado>2464</Ado><Data>80841e0000000000</Data><Cnt>1</Cnt><Retries>3</Retries>
    </InitCmd>
    <InitCmd>
     <Transition>PS</Transition><Comment>set DC activation</Comment><Cmd>5</Cmd><Adp>1001</Adp>
     <Ado>2432</Ado><Data>0003</Data><Cnt>1</Cnt><Retries>3</Retries>
    </InitCmd>
    <InitCmd>
     <Transition>PS</Transition><Comment>set sm 2</Comment><Cmd>5</Cmd><Adp>1001</Adp>
     <Ado>2064</Ado><Data>0011060064000100</Data><Cnt>1</Cnt><Retries>3</Retries>
    </InitCmd>
    <InitCmd>
     <Transition>OI</Transition><Comment>farewell</Comment><Cmd>5</Cmd><Adp>1001</Adp>
     <Ado>3968</Ado><Data>01</Data><Retries>3</Retries>
    </InitCmd>
   </InitCmds>
   <DC>
    <ReferenceClock>1</ReferenceClock><CycleTime0>2000000</CycleTime0><CycleTime1>0</CycleTime1>
    <ShiftTime>250000</ShiftTime>
   </DC>
  </Slave>
  <Cyclic>
   <CycleTime>2000</CycleTime>
   <Frame>
    <Cmd><State>OP</State><Cmd>12</Cmd><Addr>65536</Addr><DataLength>8</DataLength><Cnt>3</Cnt>
     <InputOffs>0</InputOffs><OutputOffs>0</OutputOffs></Cmd>
   </Frame>
  </Cyclic>
  <ProcessImage>
   <Inputs>
    <ByteSize>10</ByteSize>
    <Variable><Name>Drive.Inputs.Status word</Name><DataType>UINT</DataType>
     <BitSize>16</BitSize><BitOffs>16</BitOffs></Variable>
    <Variable><Name>Drive.Inputs.Position</Name><DataType>DINT</DataType>
     <BitSize>32</BitSize><BitOffs>32</BitOffs></Variable>
    <Variable><Name>Drive.WcState</Name><DataType>BOOL</DataType>
     <BitSize>1</BitSize><BitOffs>72</BitOffs></Variable>
   </Inputs>
   <Outputs>
    <ByteSize>6</ByteSize>
    <Variable><Name>Drive.Outputs.Control word</Name><DataType>UINT</DataType>
     <BitSize>16</BitSize><BitOffs>0</BitOffs></Variable>
    <Variable><Name>Drive.Outputs.Target</Name><DataType>DINT</DataType>
     <BitSize>32</BitSize><BitOffs>16</BitOffs></Variable>
   </Outputs>
  </ProcessImage>
 </Config>
</EtherCATConfig>
"""


def write_eni(folder: Path, *replacements: tuple[str, str]) -> Path:
    """Write the file with some texts replaced. Each must occur in it."""
    text = ENI
    for old, new in replacements:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "bus.xml"
    path.write_text(text, encoding="utf-8")
    return path


def line_of(text: str, *, after: str = "") -> int:
    """Return the line of a text in the file, the first one after another text."""
    start = ENI.index(after) if after else 0
    return ENI.count("\n", 0, ENI.index(text, start)) + 1
