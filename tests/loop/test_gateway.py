"""A gateway with terminals: its slots, the list 0xF030, process data, objects and faults."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.esi.reader import read_esi
from catenary.virtual import Coupler, Segment, from_esi
from catenary.virtual.faults import power_cycle
from tests.loop.gateway import AI, DI, DO, FILE, gateway, text

DOWNLOAD = 'DownloadModuleIdentList="1"'


def test_inputs_and_outputs_of_terminals(tmp_path: Path) -> None:
    with gateway(tmp_path, ["8 DI", None, "8 DO", "2 AI"]) as (_, sub, model):
        data = cat.ProcessData(sub, modules=["8 DI", None, "8 DO", "2 AI"])
        assert data.names == ("State", "Inputs", "Value 1", "Value 2", "Outputs")
        model.write_object(0x6000, 1, b"\xa5")
        model.write_object(0x6030, 2, b"\x34\x12")
        with cat.Loop(data, period=2e-3) as loop:
            data.outputs[0] = 0x5A
            for _ in range(3):
                next(loop)
            assert data.inputs.tobytes() == b"\x00\xa5\x00\x00\x34\x12"
            assert model.read_object(0x7020, 1) == b"\x5a"
        assert model.read_object(0x8030, 1) == b"\x07"  # command of the terminal in slot 3
        assert sub.sdo.read(0x8020, 1) == b"\x07"


def test_the_list_is_written_if_the_esi_requires_it(tmp_path: Path) -> None:
    with gateway(tmp_path, [DI, AI], DOWNLOAD) as (main, sub, model):
        assert sub.description.modular is not None
        assert sub.description.modular.configured == (0, 0, 0, 0)
        data = cat.ProcessData(sub)
        plan = str(main.plan(data, period=1e-3))
        assert "0xF030  0x00000000, 0x00000000, 0x00000000, 0x00000000 → 0x00000011" in plan
        with cat.Loop(data, period=2e-3) as loop:
            next(loop)
            assert len(data.inputs) == 6
        assert model.application.module_lists is not None
        assert model.application.module_lists.configured == [DI, AI, 0, 0]
        assert sub.description.modular.configured == (DI, AI)
        with cat.Loop(cat.ProcessData(sub), period=2e-3) as loop:  # again, with known idents
            next(loop)


def test_a_restarted_gateway_gets_its_list_again(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text(text(DOWNLOAD))
    model = from_esi(tmp_path / FILE, modules=[DI, AI])
    segment = Segment([Coupler(), model])
    with cat.MainDevice(segment) as main:
        sub = main.scan(esi=tmp_path / FILE)[1]
        data = cat.ProcessData(sub, modules=[DI, AI], required=False)
        with cat.Loop(data, period=2e-3) as loop:
            segment.inject(power_cycle(1, at=segment.time + 0.05, for_=0.1))
            lost = False
            for cycle in loop:
                lost = lost or not data.present
                if cycle.time > 1.0:
                    break
            assert lost
            assert data.present
        assert model.application.module_lists is not None
        assert model.application.module_lists.configured == [DI, AI, 0, 0]


def test_a_gateway_that_assigns_its_pdos_itself(tmp_path: Path) -> None:
    path = tmp_path / FILE
    path.write_text(text(DOWNLOAD).replace('PdoAssign="1"', 'PdoAssign="0"'))
    model = from_esi(path, modules=[DI, AI])
    with cat.MainDevice(Segment([model])) as main:
        table = model.application.pdos._assigned[0x1C13]
        table.places[:3], table.count = [0x1A01, 0x1A00, 0x1AFF], 3  # its own order
        [sub] = main.scan(esi=path)
        order = "in the order 0x1A01, 0x1A00, 0x1AFF, and does not accept that of the plan"
        data = cat.ProcessData(sub, modules=[DI, AI])
        with pytest.raises(ConfigurationError, match=order), cat.Loop(data, period=2e-3):
            pass
        again = cat.ProcessData(sub, modules=[DI, AI])
        assert again.names == ("Value 1", "Value 2", "Inputs", "State")
        with cat.Loop(again, period=2e-3) as loop:
            next(loop)
            assert len(again.inputs) == 6


def test_the_slots_can_be_printed(tmp_path: Path) -> None:
    with gateway(tmp_path, [DI]) as (_, sub, _):
        assert sub.esi is not None
        assert str(sub.esi.slots).startswith("slots 0 to 3  Terminal\n    0x00000011  8 DI\n")


@pytest.mark.parametrize(
    ("modules", "message"),
    [
        ([AI], r"slot 0 \(Terminal 1\): expected 2 AI \(0x00000033\), found 8 DI \(0x00000011\)"),
        ([DI], r"slot 1 \(Terminal 2\): expected empty, found 8 DO \(0x00000022\)"),
        ([DI, DO, AI], r"slot 2 \(Terminal 3\): expected 2 AI \(0x00000033\), found empty"),
    ],
)
def test_wrong_terminals_are_named(tmp_path: Path, modules: list[int], message: str) -> None:
    with gateway(tmp_path, [DI, DO]) as (_, sub, model):
        data = cat.ProcessData(sub, modules=modules)
        with pytest.raises(ConfigurationError, match=message), cat.Loop(data, period=2e-3):
            pass
        assert model.read_object(0x8000, 1) == b"\x00"  # nothing was written


def test_a_terminal_without_description_is_noted(tmp_path: Path) -> None:
    with gateway(tmp_path, [DI, DO]) as (main, _, _):
        path = tmp_path / FILE
        path.write_text(path.read_text().replace('ModuleIdent="#x22"', 'ModuleIdent="#x44"'))
        [sub] = main.scan(esi=path)
        assert "slot 1 (Terminal 2) has a module 0x00000022, which its ESI does not describe" in (
            sub.description.notes
        )
        assert sub.description.modular is not None
        modules = sub.description.modular.modules
        assert [each.name for each in modules] == ["8 DI", "unknown module"]


def test_a_device_without_lists_gets_the_requested_modules(tmp_path: Path) -> None:
    """Its mapping is then compared with the modules before anything is written."""
    with gateway(tmp_path, [DI, DO]) as (_, sub, model):
        for index in (0xF030, 0xF050):
            del model.application.dictionary.objects[index]
        [again] = sub.main.scan(esi=tmp_path / FILE)
        assert again.description.modular is not None
        assert again.description.modular.detected is None
        data = cat.ProcessData(again, modules=[DI, DO])
        with cat.Loop(data, period=2e-3) as loop:
            next(loop)
            assert (len(data.inputs), len(data.outputs)) == (2, 1)


def test_the_file_of_the_gateway_is_valid(tmp_path: Path) -> None:
    with gateway(tmp_path, [DI]):
        [device] = read_esi(tmp_path / FILE).devices
        assert device.warnings == ()


def test_inputs_by_name_of_detected_terminals(tmp_path: Path) -> None:
    with gateway(tmp_path, [DI, AI], DOWNLOAD) as (_, sub, model):
        values = cat.Inputs(sub)
        model.write_object(0x6010, 1, b"\x07\x00")
        with cat.Loop(values, period=2e-3) as loop:
            for _cycle in range(3):
                next(loop)
            assert values["Value 1"] == 7
