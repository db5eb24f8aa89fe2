"""ESI files: process data, objects and identity as the maker's XML has them."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.cia402.torque_drive import TORQUE_MODE
from rig.config.esi import EsiError, read_esi
from rig.config.pydantic_errors import load
from rig.config.segment import SlaveDevice
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.hardware.job import build_job

CONFIGS = Path(__file__).parents[2] / "configs"

# Invented devices in the form of ETG.2000, with what such files have: CDATA, hexadecimal numbers,
# gaps, arrays, PDOs that are not assigned, several revisions.
ESI = """\
<?xml version="1.0" encoding="ISO8859-1"?>
<EtherCATInfo Version="1.6">
  <Vendor><Id>#x0bad0ec0</Id><Name LcId="1033"><![CDATA[Nobody GmbH]]></Name></Vendor>
  <Descriptions><Devices>
    <Device Physics="KK">
      <Type ProductCode="#x10000104" RevisionNo="#x00100000">DI4</Type>
      <Name LcId="1033"><![CDATA[DI4 4 inputs]]></Name>
      <Fmmu>Inputs</Fmmu><Sm StartAddress="#x1000" ControlByte="#x20" Enable="1">Inputs</Sm>
      {bits}
    </Device>
    <Device Physics="KK">
      <Type ProductCode="#x10000301" RevisionNo="#x00110000">AI2</Type>
      <Name LcId="1033">AI2 older</Name>
      <TxPdo Sm="3"><Index>#x1a00</Index><Name>Old</Name>
        <Entry><Index>#x6000</Index><SubIndex>17</SubIndex><BitLen>16</BitLen><Name>Value</Name>
          <DataType>INT</DataType></Entry></TxPdo>
      <Mailbox><CoE/></Mailbox>
    </Device>
    <Device Physics="KK">
      <Type ProductCode="#x10000301" RevisionNo="#x00120000">AI2</Type>
      <Name LcId="1033">AI2 newer</Name>
      <RxPdo Fixed="1" Sm="2"><Index>#x1600</Index><Name>Set</Name></RxPdo>
      <TxPdo Sm="3"><Index>#x1a00</Index><Name>AI Channel 1</Name>
        <Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><Name>Error</Name>
          <DataType>BOOL</DataType></Entry>
        <Entry><Index>0</Index><BitLen>15</BitLen></Entry>
        <Entry><Index>#x6000</Index><SubIndex>17</SubIndex><BitLen>16</BitLen><Name>Value</Name>
          <DataType>INT</DataType></Entry></TxPdo>
      <TxPdo><Index>#x1a01</Index><Name>Not assigned</Name>
        <Entry><Index>#x6010</Index><SubIndex>1</SubIndex><BitLen>8</BitLen><Name>X</Name>
          <DataType>USINT</DataType></Entry></TxPdo>
      <TxPdo Sm="3"><Index>#x1a10</Index><Name>Samples 10</Name>
        <Entry><Index>#x6001</Index><SubIndex>1</SubIndex><BitLen>320</BitLen><Name>Samples</Name>
          <DataType>ARRAY [0..9] OF DINT</DataType></Entry></TxPdo>
      <TxPdo Sm="3"><Index>#x1a11</Index><Name>Fast</Name>
        <Entry><Index>#x6002</Index><SubIndex>1</SubIndex><BitLen>32</BitLen><Name>Sample 1</Name>
          <DataType>REAL</DataType></Entry>
        <Entry><Index>#x6002</Index><SubIndex>2</SubIndex><BitLen>32</BitLen><Name>Sample 2</Name>
          <DataType>REAL</DataType></Entry></TxPdo>
      <Mailbox DataLinkLayer="1"><CoE SdoInfo="1" PdoAssign="1">
        <InitCmd><Transition>PS</Transition><Index>#x8000</Index><SubIndex>6</SubIndex>
          <Data>E803</Data></InitCmd>
        <InitCmd><Transition>PS</Transition><Index>#x1C12</Index><SubIndex>0</SubIndex>
          <Data>00</Data></InitCmd>
        <InitCmd><Transition>SO</Transition><Index>#x8000</Index><SubIndex>7</SubIndex>
          <Data>01</Data></InitCmd></CoE></Mailbox>
    </Device>
  </Devices></Descriptions>
</EtherCATInfo>
""".format(
    bits="\n".join(
        f"<TxPdo Fixed='1' Sm='0'><Index>#x1a0{n}</Index><Name>Channel {n + 1}</Name>"
        f"<Entry><Index>#x60{n}0</Index><SubIndex>1</SubIndex><BitLen>1</BitLen>"
        "<Name>Input</Name><DataType>BOOL</DataType></Entry></TxPdo>"
        for n in range(4)
    )
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "nobody.xml"
    file.write_text(ESI, encoding="latin-1")
    return file


def device(path: Path, chosen: str) -> SlaveDevice:
    return SlaveDevice.model_validate(read_esi(path, chosen))


def test_a_terminal_of_bits(path: Path) -> None:
    found = device(path, "DI4")
    assert (found.title, found.type, found.mailbox) == ("DI4 4 inputs", "terminal", False)
    assert (found.vendor, found.product, found.revision) == (0x0BAD0EC0, 0x10000104, None)
    assert [pdo.pdo for pdo in found.inputs] == [0x1A00, 0x1A01, 0x1A02, 0x1A03]
    names = [f"channel_{n}_input" for n in (1, 2, 3, 4)]
    assert [value.name for value in found.values()] == names


def test_gaps_arrays_samples_and_objects(path: Path) -> None:
    found = device(path, "AI2")
    assert found.title == "AI2 newer"
    assert [pdo.pdo for pdo in found.inputs] == [0x1A00, 0x1A10, 0x1A11]  # one is not assigned
    assert found.outputs == ()
    values = [(value.name, value.type, value.count) for value in found.values()]
    assert values == [
        ("ai_channel_1_error", "bit", 1), ("", "bit", 15), ("ai_channel_1_value", "i16", 1),
        ("samples_10_samples", "i32", 10), ("fast_sample", "f32", 2),
    ]  # fmt: skip
    (setting,) = found.objects  # the choice of PDOs is ours, other transitions are the maker's
    assert (setting.object, setting.sub, setting.type, setting.value) == (0x8000, 6, "u16", 1000)


def test_a_revision_may_be_chosen(path: Path) -> None:
    assert device(path, "AI2@0x110000").title == "AI2 older"


@pytest.mark.parametrize(
    ("chosen", "what"),
    [
        ("EL1", "no type EL1; the file has AI2, DI4"),
        ("AI2@1", "no type AI2@1; the file has AI2, DI4"),
        ("", "several types; the file has AI2, DI4: FILE.xml#TYPE"),
    ],
)
def test_an_unknown_slave_is_refused_with_those_there_are(
    path: Path, chosen: str, what: str
) -> None:
    with pytest.raises(EsiError, match=what):
        read_esi(path, chosen)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("<EtherCATInfo>", "no XML"),
        ("<html></html>", "no ESI file: it begins with html"),
        (ESI.replace("#x10000104", "#xyz"), "'#xyz' is no number"),
        (ESI.replace("<Id>#x0bad0ec0</Id>", ""), "no vendor"),
    ],
)
def test_broken_files_are_refused_with_the_reason(path: Path, text: str, what: str) -> None:
    path.write_text(text, encoding="latin-1")
    with pytest.raises(EsiError, match=what):
        read_esi(path, "DI4")


def test_a_rig_file_may_name_a_slave_of_an_esi_file(path: Path) -> None:
    text = (CONFIGS / "rigs" / "wavebot_ethercat.yaml").read_text()
    text = text.replace("extends: wavebot.yaml", f"extends: {CONFIGS / 'rigs' / 'wavebot.yaml'}")
    text = text.replace("device: digital_input}", f"device: {path.name}#DI4}}")
    for channel in (1, 2):
        text = text.replace(
            f"slave: inputs, value: channel_{channel}",
            f"slave: inputs, value: channel_{channel}_input",
        )
    rig = path.with_name("rig.yaml")
    rig.write_text(text)
    file, locate = load(rig, RigFile)
    assert file.wiring is not None
    segment = file.wiring.segment()
    assert segment is not None
    assert segment.line[4].device.title == "DI4 4 inputs"
    assert path in locate.files


# A drive and terminals with what makers' files have besides: texts in two languages, hidden types,
# white space, virtual and mandatory PDOs, types of the device's own, truth values of a byte.
DRIVE = """\
<?xml version="1.0"?>
<EtherCATInfo xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" Version="1.2">
  <Vendor><Id>195890880</Id></Vendor>
  <Descriptions><Devices>
    <Device Physics="YY">
      <Type ProductCode="1281" RevisionNo="#x0a000002">
        Motor Controller
      </Type>
      <HideType RevisionNo="#x0a000001"/>
      <Name LcId="1031">Antrieb</Name><Name LcId="1033"><![CDATA[Drive]]></Name>
      <Profile><ProfileNo>402</ProfileNo></Profile>
      <RxPdo Fixed="true" Sm="2"><Index>#x1600</Index><Name>Outputs</Name>
        <Entry><Index>#x6040</Index><SubIndex>0</SubIndex><BitLen>16</BitLen>
          <Name>Controlword</Name><DataType>UINT</DataType></Entry></RxPdo>
      <Mailbox DataLinkLayer="true"><CoE SdoInfo="true" PdoAssign="false">{command}</CoE></Mailbox>
      <Dc>{modes}</Dc>
    </Device>
    <Device Physics="KK">
      <Type ProductCode="#x2" RevisionNo="1">Mixed</Type><Name LcId="1031">Gemischt</Name>
      <Profile><Dictionary><DataTypes>
        <DataType><Name>DT0800EN16</Name><BaseType>UINT</BaseType><BitSize>16</BitSize></DataType>
      </DataTypes></Dictionary></Profile>
      <TxPdo Sm="3" Virtual="1"><Index>#x1a0f</Index><Name>Tool</Name>
        <Entry><Index>#x1</Index><BitLen>32</BitLen><DataType>UDINT</DataType></Entry></TxPdo>
      <TxPdo Mandatory="true"><Index>#x1a00</Index><Name>State</Name>
        <Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>2</BitLen><Name>Limit</Name>
          <DataType>BIT2</DataType></Entry>
        <Entry><Index>#x0</Index><BitLen>6</BitLen><DataType></DataType></Entry>
        <Entry><Index>#x6000</Index><SubIndex>2</SubIndex><BitLen>8</BitLen><Name>Ready</Name>
          <DataType>BOOL</DataType></Entry>
        <Entry><Index>#x6000</Index><SubIndex>3</SubIndex><BitLen>16</BitLen><Name>Range</Name>
          <DataType>DT0800EN16</DataType></Entry>
        <Entry><Index>#x6000</Index><SubIndex>4</SubIndex><BitLen>32</BitLen><Name>Time</Name>
          <DataType>UINT32</DataType></Entry></TxPdo>
    </Device>
  </Devices></Descriptions>
</EtherCATInfo>
"""


def mode(activate: str, cycle: str = "") -> str:
    return f"<OpMode><Name>x</Name><AssignActivate>{activate}</AssignActivate>{cycle}</OpMode>"


def drive(folder: Path, modes: str = "", command: str = "") -> SlaveDevice:
    file = folder / "drive.xml"
    file.write_text(DRIVE.replace("{modes}", modes).replace("{command}", command))
    return device(file, "Motor Controller")


def test_a_device_of_profile_402_is_a_drive_whose_process_data_the_drivers_choose(
    tmp_path: Path,
) -> None:
    found = drive(tmp_path)
    assert (found.title, found.type) == ("Drive", "drive")
    assert (found.vendor, found.product) == (0x0BAD0EC0, 0x501)
    assert (found.outputs, found.inputs, found.sync0) == ((), (), False)


@pytest.mark.parametrize(
    ("modes", "needed"),
    [
        ("", False),
        (mode("#x0") + mode("#x300"), False),
        (mode("#x300") + mode("#x700"), True),
        (mode("#x0300", '<CycleTimeSync0 Factor="0">0</CycleTimeSync0>'), True),
        (mode("#x300", '<CycleTimeSync0 Factor="1">500000</CycleTimeSync0>'), True),
        (mode("#x0300", '<CycleTimeSync0 Factor="-10">0</CycleTimeSync0>') + mode("768"), True),
    ],
)
def test_a_slave_without_a_mode_but_sync0_needs_it(
    tmp_path: Path, modes: str, needed: bool
) -> None:
    found = drive(tmp_path, modes)
    assert (found.sync0, found.sync0_cycles_ns) == (needed, ())


FIXED = '<CycleTimeSync0 Factor="0">500000</CycleTimeSync0>'


@pytest.mark.parametrize(
    ("modes", "needed", "cycles"),
    [
        (mode("#x300", FIXED), True, (500_000,)),
        (mode("#x300", FIXED.replace(' Factor="0"', "")), True, (500_000,)),
        (mode("#x300", FIXED) + mode("#x300", FIXED.replace("5", "2")), True, (500_000, 200_000)),
        (mode("#x300", FIXED) + mode("#x300"), True, ()),
        (mode("#x0") + mode("#x300", FIXED), False, (500_000,)),
    ],
)
def test_a_fixed_time_of_sync0_is_the_cycle_that_it_must_have(
    tmp_path: Path, modes: str, needed: bool, cycles: tuple[int, ...]
) -> None:
    found = drive(tmp_path, modes)
    assert (found.sync0, found.sync0_cycles_ns) == (needed, cycles)


@pytest.mark.parametrize(
    ("modes", "shown"),
    [
        (mode("#x700"), "0x0700"),
        (mode("#x730") + mode("#x700"), "0x0730, 0x0700"),
        (mode("#x300", '<CycleTimeSync0 Factor="-10">0</CycleTimeSync0>'), "0x0300"),
    ],
)
def test_a_slave_that_needs_more_than_one_sync0_in_a_cycle_is_refused(
    tmp_path: Path, modes: str, shown: str
) -> None:
    with pytest.raises(EsiError, match=f"have AssignActivate {shown}; allowed one with 0x0300"):
        drive(tmp_path, modes)


def test_types_of_a_device_and_of_other_tools(tmp_path: Path) -> None:
    drive(tmp_path)
    found = device(tmp_path / "drive.xml", "Mixed")
    assert (found.title, found.mailbox) == ("Gemischt", False)
    (pdo,) = found.inputs  # not the virtual one
    assert pdo.pdo == 0x1A00
    assert [(value.name, value.type, value.count) for value in pdo.values] == [
        ("", "bit", 2), ("", "bit", 6), ("state_ready", "u8", 1), ("state_range", "u16", 1),
        ("state_time", "u32", 1),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("data", "what"),
    [
        ("00112233445566", "object 0x8000:6 is set with 7 octets at once; allowed 1, 2, 4"),
        ("0x12", "object 0x8000:6: data '0x12' are no octets"),
    ],
)
def test_an_object_that_cannot_be_set_is_refused(tmp_path: Path, data: str, what: str) -> None:
    command = (
        "<InitCmd><Transition> PS </Transition><Index>#x8000</Index><SubIndex>6</SubIndex>"
        f"<Data>{data}</Data></InitCmd>"
    )
    with pytest.raises(EsiError, match=what):
        drive(tmp_path, command=command)


def test_an_object_that_is_set_by_complete_access_is_refused(tmp_path: Path) -> None:
    command = (
        '<InitCmd CompleteAccess="{}"><Transition>PS</Transition><Index>#x8000</Index>'
        "<SubIndex>0</SubIndex><Data>01000500</Data></InitCmd>"
    )
    (setting,) = drive(tmp_path, command=command.format("false")).objects
    assert (setting.sub, setting.type, setting.value) == (0, "u32", 0x00050001)
    with pytest.raises(EsiError, match="object 0x8000:0 is set by complete access"):
        drive(tmp_path, command=command.format("1"))


def test_an_entry_longer_than_a_frame_is_refused(path: Path) -> None:
    path.write_text(ESI.replace("<BitLen>15</BitLen>", "<BitLen>1000000000</BitLen>"))
    with pytest.raises(EsiError, match="0x0000:0 has 1000000000 bits; allowed 0 to 11888"):
        read_esi(path, "AI2")


def test_a_drive_of_an_esi_file_may_be_either_drive_of_the_rig(tmp_path: Path) -> None:
    """Its objects come before those of the drivers, which must win: 0x6060 is torque mode."""
    command = (
        "<InitCmd><Transition>PS</Transition><Index>#x6060</Index><SubIndex>0</SubIndex>"
        "<Data>08</Data></InitCmd>"
    )
    drive(tmp_path, command=command)
    text = (CONFIGS / "rigs" / "wavebot_ethercat.yaml").read_text()
    text = text.replace("extends: wavebot.yaml", f"extends: {CONFIGS / 'rigs' / 'wavebot.yaml'}")
    for name, kind in (("heave", "torque_drive"), ("stator", "position_drive")):
        old, new = f"name: {name}, device: {kind}", 'device: "drive.xml#Motor Controller"'
        assert old in text
        text = text.replace(old, f"name: {name}, {new}")
    (tmp_path / "rig.yaml").write_text(text)
    file, _ = load(tmp_path / "rig.yaml", RigFile)
    (service,) = (one for one in build_job(file).io_processes if one.name == "ethercat")
    steps = service.config["slaves"][0]["steps"]
    modes = [step[4] for step in steps if step[:2] == (0x6060, 0)]
    assert modes == [8, TORQUE_MODE]


def entry(sub: int, bits: int, name: str, kind: str, index: str = "#x6401") -> str:
    return (
        f"<Entry><Index>{index}</Index><SubIndex>{sub}</SubIndex><BitLen>{bits}</BitLen>"
        f"<Name>{name}</Name><DataType>{kind}</DataType></Entry>"
    )


def terminal(folder: Path, entries: str, tag: str = "TxPdo", pdo: str = "#x1a00") -> SlaveDevice:
    """Return a terminal of one PDO named P, without a mailbox."""
    file = folder / "terminal.xml"
    file.write_text(
        "<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices><Device>"
        '<Type ProductCode="1" RevisionNo="1">T</Type>'
        f'<{tag} Sm="3"><Index>{pdo}</Index><Name>P</Name>{entries}</{tag}>'
        "</Device></Devices></Descriptions></EtherCATInfo>"
    )
    return device(file, "T")


def values(found: SlaveDevice) -> list[tuple[str, int, str, int]]:
    return [(value.name, value.sub, value.type, value.count) for value in found.values()]


@pytest.mark.parametrize(
    "names",
    [("Value1", "Value2"), ("Channel 1", "Channel 2"), ("No of Samples 1", "No of Samples 2"),
     ("Sample rate 1", "Sample rate 2"), ("Ch1 Sample", "Ch2 Sample"),
     ("SubIndex 001", "SubIndex 002")],
)  # fmt: skip
def test_distinct_signals_of_one_object_are_never_joined(
    tmp_path: Path, names: tuple[str, str]
) -> None:
    one, two = names
    found = values(terminal(tmp_path, entry(1, 16, one, "INT") + entry(2, 16, two, "INT")))
    assert [(sub, kind, count) for _, sub, kind, count in found] == [(1, "i16", 1), (2, "i16", 1)]


def test_samples_are_inputs_of_that_name_at_sub_indices_that_follow(tmp_path: Path) -> None:
    entries = (
        entry(1, 16, "Ch1 Sample 0", "INT") + entry(2, 16, "Ch1 Sample 1", "INT")
        + entry(3, 16, "Ch2 Sample 0", "INT") + entry(4, 16, "Ch2 Sample 1", "INT")
        + entry(6, 16, "Ch2 Sample 2", "INT") + entry(7, 16, "Ch2 Sample 3", "UINT")
    )  # fmt: skip
    assert values(terminal(tmp_path, entries)) == [
        ("p_ch1_sample", 1, "i16", 2), ("p_ch2_sample", 3, "i16", 2),
        ("p_ch2_sample_2", 6, "i16", 1), ("p_ch2_sample_3", 7, "u16", 1),
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["Out", "Sample"])
def test_outputs_are_never_joined(tmp_path: Path, name: str) -> None:
    entries = "".join(entry(n + 1, 8, f"{name}{n}", "BYTE") for n in range(32))
    found = values(terminal(tmp_path, entries, "RxPdo", "#x1600"))
    assert found == [(f"p_{name.lower()}{n}", n + 1, "u8", 1) for n in range(32)]


@pytest.mark.parametrize(("tag", "pdo"), [("RxPdo", "#x1600"), ("TxPdo", "#x1a00")])
def test_the_elements_of_an_array_are_values_of_their_own(
    tmp_path: Path, tag: str, pdo: str
) -> None:
    entries = entry(1, 48, "Level", "ARRAY [1..3] OF INT")
    entries += entry(4, 16, "Flag", "ARRAY [0..15] OF BOOL")
    entries += entry(20, 8, "Ready", "BOOL")
    found = values(terminal(tmp_path, entries, tag, pdo))
    assert found == [
        *((f"p_level_{n}", n, "i16", 1) for n in (1, 2, 3)),
        *((f"p_flag_{n}", 4 + n, "bit", 1) for n in range(16)),
        ("p_ready", 20, "u8", 1),
    ]


def test_an_array_of_outputs_is_never_one_value(tmp_path: Path) -> None:
    entries = entry(1, 64, "Samples", "ARRAY [0..1] OF DINT")
    assert values(terminal(tmp_path, entries, "RxPdo", "#x1600")) == [
        ("p_samples_0", 1, "i32", 1), ("p_samples_1", 2, "i32", 1),
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["Samples", "Data"])
def test_an_array_with_more_elements_than_sub_indices_is_a_gap(tmp_path: Path, name: str) -> None:
    entries = entry(1, 8 * 300, name, "ARRAY [0..299] OF BYTE") + entry(2, 8, "Next", "USINT")
    gaps = [("", 0, "bit", 256)] * 9 + [("", 0, "bit", 96)]
    assert values(terminal(tmp_path, entries)) == [*gaps, ("p_next", 2, "u8", 1)]
    entries = entry(1, 8 * 255, "Samples", "ARRAY [0..254] OF BYTE")
    assert values(terminal(tmp_path, entries)) == [("p_samples", 1, "u8", 255)]


@pytest.mark.parametrize(("tag", "pdo"), [("RxPdo", "#x1a00"), ("TxPdo", "#x1600")])
def test_without_a_mailbox_the_index_of_a_pdo_does_not_matter(
    tmp_path: Path, tag: str, pdo: str
) -> None:
    found = terminal(tmp_path, entry(1, 8, "Port", "USINT"), tag, pdo)
    assert values(found) == [("p_port", 1, "u8", 1)]
    what = "0x1a00 is no mapping of outputs" if tag == "RxPdo" else "0x1600 is no mapping of inputs"
    with pytest.raises(ValueError, match=what):
        SlaveDevice.model_validate(found.model_dump() | {"mailbox": True})


@pytest.mark.parametrize("encoding", ["GB2312", "gbk", "Big5", "UTF-16", "UTF-8", "utf-8-sig"])
def test_a_file_is_read_in_any_encoding_of_python(path: Path, encoding: str) -> None:
    declared = "UTF-8" if encoding == "utf-8-sig" else encoding
    title = "\u56db" if encoding == "Big5" else "\u56db\u8def\u8f93\u5165"
    text = ESI.replace("ISO8859-1", declared).replace("DI4 4 inputs", title)
    path.write_bytes(text.encode(encoding))
    assert device(path, "DI4").title == title


@pytest.mark.parametrize(
    ("encoding", "what"),
    [
        ("nonsense", "encoding nonsense: unknown encoding: nonsense"),
        ("hex", "encoding hex: 'hex' is not a text encoding"),
        ("GB2312", "encoding GB2312: 'gb2312' codec can't decode byte 0xe9"),
        ("UTF-8", "encoding UTF-8: 'utf-8' codec can't decode byte 0xe9"),
    ],
)
def test_an_encoding_that_python_cannot_decode_is_refused(
    path: Path, encoding: str, what: str
) -> None:
    text = ESI.replace("ISO8859-1", encoding).replace("4 inputs", "4 entr\u00e9es")
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(EsiError, match=what):
        read_esi(path, "DI4")
