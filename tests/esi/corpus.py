"""Generated ESI files, one for each quirk of real files.

`FILES` are usable files by the name of their quirk, `FAULTY_FILES` are refused. `device`, `module`
and `esi` make further files.
"""

from __future__ import annotations

VENDOR = '<Vendor><Id>#x00000ABC</Id><Name LcId="1033">Example</Name></Vendor>'
GROUP = "<Groups><Group><Type>IO</Type><Name>In and out</Name></Group></Groups>"
TYPE = '<Type ProductCode="#x1234" RevisionNo="#x10002">EX1</Type>'
SM = (
    '<Sm MinSize="34" MaxSize="128" DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" '
    'Enable="1">MBoxOut</Sm>'
    '<Sm DefaultSize="128" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>'
    '<Sm DefaultSize="2" StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>'
    '<Sm DefaultSize="2" StartAddress="#x1400" ControlByte="#x20" Enable="1">Inputs</Sm>'
)
RX = (
    '<RxPdo Fixed="1" Mandatory="1" Sm="2"><Index>#x1600</Index><Name>Out</Name>'
    "<Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>Value</Name>"
    "<DataType>INT</DataType></Entry></RxPdo>"
)
TX = (
    '<TxPdo Fixed="1" Sm="3"><Index>#x1A00</Index><Name>In</Name>'
    "<Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>Value</Name>"
    "<DataType>INT</DataType></Entry></TxPdo>"
)
MAILBOX = '<Mailbox><CoE SdoInfo="1" CompleteAccess="1"/></Mailbox>'
DECLARATION = '<?xml version="1.0" encoding="utf-8"?>\n'


def device(*parts: str, kind: str = TYPE, names: str = "<Name>Example</Name>") -> str:
    """Return a device; the parts follow its names."""
    return f'<Device Physics="YY">{kind}{names}<GroupType>IO</GroupType>{"".join(parts)}</Device>'


def module(ident: str, *parts: str, kind: str = "") -> str:
    """Return a module; the parts follow its name."""
    return (
        f'<Module><Type ModuleIdent="{ident}"{kind}>M</Type><Name>M</Name>{"".join(parts)}</Module>'
    )


def esi(
    *devices: str, modules: str = "", top: str = "", vendor: str = VENDOR, root: str = ""
) -> str:
    """Return a file with devices, one per line from line 3."""
    lines = "".join(f"{each}\n" for each in devices)
    modules = f"<Modules>{modules}</Modules>" if modules else ""
    return (
        f"{DECLARATION}<EtherCATInfo{root}>{top}{vendor}<Descriptions>{GROUP}<Devices>\n{lines}"
        f"</Devices>{modules}</Descriptions></EtherCATInfo>"
    )


def dictionary(types: str, objects: str) -> str:
    """Return a profile with a dictionary."""
    return (
        "<Profile><ProfileNo>5001</ProfileNo><Dictionary>"
        f"<DataTypes>{types}</DataTypes><Objects>{objects}</Objects></Dictionary></Profile>"
    )


def entry(*parts: str) -> str:
    """Return a TxPDO with one entry."""
    return (
        f'<TxPdo Sm="3"><Index>#x1A00</Index><Name>In</Name><Entry>{"".join(parts)}</Entry></TxPdo>'
    )


TYPES = (
    "<DataType><Name>DTARR</Name><BaseType>UINT</BaseType><BitSize>48</BitSize>"
    "<ArrayInfo><LBound>1</LBound><Elements>3</Elements></ArrayInfo></DataType>"
    "<DataType><Name>DTENUM</Name><BaseType>USINT</BaseType><BitSize>8</BitSize>"
    "<EnumInfo><Text>off</Text><Enum>0</Enum></EnumInfo>"
    '<EnumInfo><Text LcId="1031">an</Text><Text LcId="1033">on</Text><Enum>1</Enum></EnumInfo>'
    "</DataType>"
    "<DataType><Name>DT2000</Name><BitSize>64</BitSize>"
    "<SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type><BitSize>8</BitSize>"
    "<BitOffs>0</BitOffs></SubItem>"
    "<SubItem><Name>Elements</Name><Type>DTARR</Type><BitSize>48</BitSize><BitOffs>16</BitOffs>"
    "<Flags><Access>rw</Access><PdoMapping>tr</PdoMapping></Flags></SubItem></DataType>"
    "<DataType><Name>DT2001</Name><BitSize>40</BitSize>"
    "<SubItem><Name>Count</Name><Type>USINT</Type><BitSize>8</BitSize><BitOffs>0</BitOffs>"
    "</SubItem>"
    "<SubItem><Name>Mode</Name><Type>DTENUM</Type><BitSize>8</BitSize><BitOffs>16</BitOffs>"
    "<DefaultData>01</DefaultData><Flags><Access>RW</Access></Flags></SubItem>"
    "<SubItem><SubIdx>#x5</SubIdx><Name>Gain</Name><Type>REAL</Type><BitSize>32</BitSize>"
    "<BitOffs>24</BitOffs></SubItem></DataType>"
)
OBJECTS = (
    '<Object><Index DependOnSlot="1">#x2000</Index><Name>List</Name><Type>DT2000</Type>'
    "<BitSize>64</BitSize><Info><SubItem><Name>SubIndex 000</Name><Info><DefaultData>03"
    "</DefaultData></Info></SubItem><SubItem><Name>SubIndex 001</Name><Info><DefaultValue>#x1A2B"
    "</DefaultValue></Info></SubItem></Info></Object>"
    "<Object><Index>#x2001</Index><Name>Settings</Name><Type>DT2001</Type><BitSize>40</BitSize>"
    "<Info><SubItem><Name>Gain</Name><Info><DefaultValue>0.5</DefaultValue><Unit>#xFD040000</Unit>"
    "</Info></SubItem></Info><Flags><Access>rw</Access></Flags></Object>"
    "<Object><Index>#x2002</Index><Name>Mode</Name><Type>DTENUM</Type><BitSize>8</BitSize>"
    "<Info><MinValue>0</MinValue><MaxValue>1</MaxValue><DefaultValue>1</DefaultValue></Info>"
    "<Flags><Access>rw</Access><PdoMapping>R</PdoMapping></Flags></Object>"
    "<Object><Index>#x2003</Index><Name>Offset</Name><Type>INT</Type><BitSize>16</BitSize>"
    "<Info><DefaultValue>-2</DefaultValue></Info></Object>"
    "<Object><Index>#x2004</Index><Name>Label</Name><Type>STRING(4)</Type><BitSize>32</BitSize>"
    "<Info><DefaultString>abcd</DefaultString></Info></Object>"
)
INIT = (
    '<Mailbox><CoE><InitCmd CompleteAccess="1" Fixed="true"><Transition>PS</Transition>'
    "<Transition>SO</Transition><Index>#x1C12</Index><SubIndex>0</SubIndex>"
    '<Data AdaptAutomatically="1">01 00 00 16</Data><Comment>assign</Comment></InitCmd></CoE>'
    "</Mailbox>"
)
CLOCKS = (
    "<Dc><OpMode><Name>DC-Synchron</Name><Desc>with SYNC0</Desc><AssignActivate>#x730"
    '</AssignActivate><CycleTimeSync0 Factor="1">0</CycleTimeSync0><ShiftTimeSync0 Factor="-1" '
    'Input="1">-5000</ShiftTimeSync0><CycleTimeSync1 Factor="-2">0</CycleTimeSync1>'
    '<ShiftTimeSync1>100</ShiftTimeSync1><Sm No="3"><SyncType>2</SyncType><CycleTime>1000'
    '</CycleTime><ShiftTime>5</ShiftTime><Pdo OSFac="10">#x1A00</Pdo><Pdo>#x1A01</Pdo></Sm>'
    "</OpMode></Dc>"
)
MAPPINGS = (
    '<Info><VendorSpecific><TwinCAT><AlternativeSmMapping Default="1"><Name>Standard</Name>'
    '<Sm No="3"><Pdo>#x1A00</Pdo><Pdo>#x1A01</Pdo></Sm></AlternativeSmMapping>'
    '<AlternativeSmMapping><Name>Compact</Name><Sm No="3"><Pdo>#x1A02</Pdo></Sm>'
    "</AlternativeSmMapping></TwinCAT></VendorSpecific></Info>"
)
SLOTS = (
    '<Slots SlotPdoIncrement="#x10" SlotIndexIncrement="2048" MaxSlotCount="4" '
    'DownloadModuleIdentList="1" IdentifyModuleBy="ModuleIdent">'
    '<Slot MinInstances="1" MaxInstances="2"><Name>Axis</Name>'
    '<ModuleIdent>#x01</ModuleIdent><ModuleIdent Default="1">#x02</ModuleIdent></Slot>'
    '<Slot MinInstances="0" MaxInstances="1" SlotPdoIncrement="3"><Name>Terminal</Name>'
    "<ModuleClass><Class>DI</Class></ModuleClass></Slot></Slots>"
)
MODULES = (
    module("#x01", RX)
    + module("#x02", RX, TX, INIT, dictionary(TYPES, OBJECTS))
    + module("3", kind=' ModuleClass="DI"')
    + module("4", kind=' ModuleClass="AI"')
)
EEPROM = (
    '<Eeprom AssignToPdi="1"><ByteSize>2048</ByteSize><ConfigData>050E 0344\n1027</ConfigData>'
    "<BootStrap>0010800080108000</BootStrap>"
    "<Category><CatNo>2048</CatNo><Data>0102</Data></Category>"
    "<Category><CatNo>2049</CatNo><DataString>abc</DataString></Category>"
    "<Category><CatNo>#x802</CatNo><DataUINT>#x1234</DataUINT></Category>"
    "<Category><CatNo>2051</CatNo><DataUDINT>1</DataUDINT></Category></Eeprom>"
)
INFO = (
    "<Info><Electrical><EBusCurrent>-2000</EBusCurrent></Electrical><StateMachine><Timeout>"
    "<PreopTimeout>2000</PreopTimeout><SafeopOpTimeout>9000</SafeopOpTimeout>"
    "<BackToInitTimeout>5000</BackToInitTimeout><BackToSafeopTimeout>200</BackToSafeopTimeout>"
    "</Timeout></StateMachine><Mailbox><Timeout><RequestTimeout>100</RequestTimeout>"
    "<ResponseTimeout>2000</ResponseTimeout></Timeout></Mailbox><EtherCATController>"
    "<DpramSize>4096</DpramSize><SmCount>4</SmCount><FmmuCount>3</FmmuCount></EtherCATController>"
    "<IdentificationAdo>#x12</IdentificationAdo><Port><Type>MII</Type></Port></Info>"
)
ESC = "<ESC><Reg0400>#x9C2</Reg0400><Reg0410>0</Reg0410><Reg0420>1000</Reg0420></ESC>"
WHOLE = device(INFO, SM, RX, TX, INIT, CLOCKS, SLOTS, ESC, EEPROM, dictionary(TYPES, OBJECTS))

CHINESE = esi(device(SM, RX, TX, names="<Name>伺服驱动器</Name>"))
JAPANESE = esi(device(SM, RX, TX, names="<Name>サーボ表示</Name>"))
GERMAN = esi(device(SM, RX, TX, names="<Name>für µm</Name>"))
PLAIN = esi(device(SM, RX, TX, MAILBOX))

FILES: dict[str, bytes] = {
    "plain": PLAIN.encode(),
    "every element": esi(WHOLE, modules=MODULES).encode(),
    "no declaration": PLAIN.removeprefix(DECLARATION).encode(),
    "no declaration, Latin-1": GERMAN.removeprefix(DECLARATION).encode("latin-1"),
    "byte-order mark": PLAIN.encode("utf-8-sig"),
    "UTF-16": PLAIN.replace("utf-8", "utf-16").encode("utf-16"),
    "UTF-16 declared": PLAIN.replace("utf-8", "utf-16").encode(),
    "gb2312": CHINESE.replace("utf-8", "gb2312").encode("gb2312"),
    "gb2312, declared as UTF-8": CHINESE.encode("gb2312"),
    "UTF-8, declared as gb2312": CHINESE.replace("utf-8", "gb2312").encode(),
    "shift_jis": JAPANESE.replace("utf-8", "shift_jis").encode("shift_jis"),
    "windows-1252": GERMAN.replace("utf-8", "windows-1252").encode("cp1252"),
    "Latin-1, declared as UTF-8": GERMAN.encode("latin-1"),
    "unknown encoding": GERMAN.replace("utf-8", "x-vendor").encode(),
    "faulty characters": CHINESE.encode().replace("驱".encode(), b"\xff"),
    "control characters": PLAIN.replace("Example<", "Exam\x01ple<").encode() + b"\x1a",
    "namespace": PLAIN.replace("EtherCATInfo", "e:EtherCATInfo")
    .replace("<e:EtherCATInfo", '<e:EtherCATInfo xmlns:e="urn:e" xsi:x="1"')
    .encode(),
    "numbers": esi(
        device(
            SM,
            entry("<Index>#x0x6041</Index><SubIndex> 0x01 </SubIndex><BitLen>#x10</BitLen>"),
            kind='<Type ProductCode="0x1234" RevisionNo=" 65538 ">EX1</Type>',
        )
    ).encode(),
    "absurd numbers": esi(
        device(
            SM.replace('"#x1000"', '"999999999999999999999999999999999999999999999999"'),
            entry("<Index>#xFFFFFFFFFF</Index><SubIndex>-1</SubIndex><BitLen>1e99</BitLen>"),
        )
    ).encode(),
    "newlines in names": esi(device(SM, names="<Name>\n  Exam\r\n  ple\t</Name>")).encode(),
    "languages": esi(
        device(names='<Name LcId="1031">Beispiel</Name><Name LcId="1033">Example</Name>')
    ).encode(),
    "no language": esi(device(names='<Name LcId="2052">例</Name><Name>Example</Name>')).encode(),
    "BitLen 0": esi(
        device(SM, entry("<Index>0</Index><BitLen>0</BitLen>"), RX.replace(">16<", ">0<"))
    ).encode(),
    "no SubIndex": esi(device(SM, entry("<Index>#x6000</Index><BitLen>8</BitLen>"))).encode(),
    "no BitLen": esi(device(SM, entry("<Index>#x6000</Index><DataType>UINT</DataType>"))).encode(),
    "gap": esi(device(SM, entry("<Index>#x0</Index><BitLen>4</BitLen>"))).encode(),
    "PDO options": esi(
        device(
            SM,
            '<TxPdo Virtual="1" OSMax="100" OverwrittenByModule="1"><Index DependOnSlot="1">#x1A00'
            '</Index><Name>A</Name><Exclude>#x1A01</Exclude><Exclude DependOnSlot="true">#x1A02'
            "</Exclude><ExcludedSm>2</ExcludedSm></TxPdo>",
        )
    ).encode(),
    "SyncManager that does not exist": esi(device(SM, TX.replace('Sm="3"', 'Sm="5"'))).encode(),
    "unknown SyncManager": esi(device(SM.replace("Outputs", "AxisIn"), RX, TX)).encode(),
    "alternative mappings": esi(device(MAPPINGS, SM, TX)).encode(),
    "SyncManager options": esi(
        device(
            '<Sm StartAddress="#x1000" Enable="0" Virtual="1" OpOnly="1" FixedAssignment="true">'
            "Outputs</Sm>"
        )
    ).encode(),
    "all mailbox protocols": esi(
        device(
            "<Mailbox><AoE/><EoE/><FoE/><SoE/><VoE/>"
            '<CoE PdoAssign="1" PdoConfig="true" PdoUpload="1" SegmentedSdo="1" DS402Channels="2"/>'
            "</Mailbox>"
        )
    ).encode(),
    "whole EEPROM": esi(device("<Eeprom><Data>0102</Data></Eeprom>")).encode(),
    "init commands": esi(
        device(INIT.replace("<InitCmd", "<InitCmd><Index>1</Index></InitCmd><InitCmd", 1))
    ).encode(),
    "type attributes": esi(
        device(
            '<HideType ProductCode="#x1234" RevisionNo="#x10001"/><HideType RevisionNo="1"/>'
            '<AlternativeType ProductCode="7">EX7</AlternativeType><SubDevice>EX2</SubDevice>',
            kind='<Type ProductCode="#x1234" RevisionNo="#x10002" CheckRevisionNo="EQ_OR_G" '
            'UseLrdLwr="1" TcCfgModeSafeOp="true">EX1</Type>',
        )
    ).encode(),
    "vendor in device": esi(
        device("<Vendor><Id>5</Id><Name>Five</Name></Vendor>"), vendor=""
    ).encode(),
    "no vendor": esi(device(), vendor="").encode(),
    "references": esi(
        device(SLOTS, "<Profile><DictionaryFile>Sub\\Dict.xml</DictionaryFile></Profile>"),
        top="<InfoReference>Sub\\Modules.xml</InfoReference>",
    ).encode(),
    "faulty device before a good one": esi(
        device(kind='<Type ProductCode="abc-x">BAD</Type>'), device(SM)
    ).encode(),
    "unknown elements": esi(
        device("<Info><Port><Type>MII</Type></Port></Info>", "<Extra><A/></Extra><Extra/>")
    ).encode(),
    "modules only": (
        f"<EtherCATModule>{VENDOR}<Modules>{MODULES}</Modules></EtherCATModule>".encode()
    ),
    "dictionary only": (
        f"<EtherCATDict><Dictionary><DataTypes>{TYPES}</DataTypes><Objects>{OBJECTS}</Objects>"
        "</Dictionary></EtherCATDict>"
    ).encode(),
}

FAULTY_FILES: dict[str, bytes] = {
    "empty": b"",
    "truncated": PLAIN.encode()[:-30],
    "not XML": b"%PDF-1.4",
    "another root": b"<html><body/></html>",
    "UTF-32": PLAIN.encode("utf-32"),
    "document type": PLAIN.replace("?>", '?><!DOCTYPE a SYSTEM "file:///etc/passwd">').encode(),
    "entity bomb": PLAIN.replace(
        "?>",
        '?><!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;">]>',
    )
    .replace("Example<", "&c;<")
    .encode(),
    "unknown entity": PLAIN.replace("Example<", "&nbsp;<").encode(),
    "deep nesting": esi(device("<A>" * 100_000 + "</A>" * 100_000)).encode(),
    "many attributes": esi(
        device("<A " + " ".join(f'a{n}=""' for n in range(5000)) + "/>")
    ).encode(),
    "long attribute": esi(device(f'<A a="{"x" * 100_000}"/>')).encode(),
    "no device": esi().encode(),
    "only a faulty device": esi(
        device(kind='<Type ProductCode="#x1334910000">BAD</Type>')
    ).encode(),
    "modules without identification": (
        b"<EtherCATModule><Modules><Module/></Modules></EtherCATModule>"
    ),
    "no dictionary": b"<EtherCATDict/>",
}
