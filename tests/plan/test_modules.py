"""Modules of a modular device in a plan, from descriptions made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from catenary.errors import ConfigurationError
from catenary.esi.apply import applied
from catenary.esi.configured import expand, with_reported_modules
from catenary.esi.device import EsiDevice, EsiInitCommand
from catenary.model.device import DeviceDescription, Identity, MailboxLayout
from catenary.plan.modules import (
    ident_difference,
    make_module_plan,
    module_lines,
    with_requested_modules,
)
from catenary.plan.planner import Plan, make_plan
from catenary.plan.request import DeviceRequest, ImageLayout, RequestTables, Views
from catenary.wire.sii import MailboxProtocol
from tests.esi.modular import AI, DI, DO, MODULES, STATUS, coupler
from tests.plan.devices import coupler as plain


def described(esi: EsiDevice, **lists: tuple[int, ...] | None) -> DeviceDescription:
    """Return the description of the coupler, with its lists of idents."""
    base = replace(
        plain(0),
        identity=Identity(esi.key.vendor, esi.key.product, esi.key.revision, 0),
        mailbox=MailboxLayout(0x1000, 128, 0x1080, 128, MailboxProtocol.COE, pdo_assign=True),
    )
    device = applied(base, esi)
    assert device.modular is not None
    device = replace(device, modular=replace(device.modular, **lists))  # type: ignore[arg-type]
    return with_reported_modules(device, esi)


class Request:
    """Request for modules without process data."""

    def __init__(self, request: DeviceRequest) -> None:
        self.request = request

    def pdos(self, period_ns: int) -> dict[int, DeviceRequest]:
        return {0: self.request}

    def tables(self, layout: ImageLayout) -> RequestTables:
        return RequestTables()

    def bind(self, views: Views) -> None: ...


def planned(device: DeviceDescription, esi: EsiDevice, choice: Sequence[str | int | None]) -> Plan:
    return make_plan([device], [Request(DeviceRequest(modules=expand(esi, choice)))])


def mapped(device: DeviceDescription) -> list[int]:
    return [pdo.index for each in (*device.outputs, *device.inputs) for pdo in each.pdos]


def test_the_default_modules_count_without_lists() -> None:
    device = described(coupler())
    assert device.modular is not None
    assert device.modular.modules_source == "default modules of the ESI"
    assert mapped(device) == [0x1AFF, 0x1A00]
    assert [each.index for each in device.init_commands] == [0x8000]


def test_the_detected_modules_count_more_than_the_configured_ones() -> None:
    device = described(coupler(), detected=(DO, AI, 0), configured=(DI, 0, 0))
    assert mapped(device) == [0x1600, 0x1AFF, 0x1A01]
    assert device.modular is not None
    assert device.modular.modules_source == "reported in 0xF050"


def test_the_configured_modules_count_if_none_are_detected() -> None:
    device = described(coupler(), detected=(0, 0, 0), configured=(0, AI, 0))
    assert mapped(device) == [0x1AFF, 0x1A01]


def test_pdos_follow_by_group_then_by_slot() -> None:
    modules = (replace(MODULES[0], pdo_group=2), replace(MODULES[2], pdo_group=1))
    device = described(coupler(modules=modules), detected=(DI, AI, DI))
    assert mapped(device) == [0x1AFF, 0x1A01, 0x1A00, 0x1A02]


def test_a_pdo_of_the_device_gives_way_to_a_module() -> None:
    own = replace(STATUS, index=0x1A00, overwritten_by_module=True)
    device = described(coupler(pdos=(own,)))
    assert [pdo.name for pdo in device.input_pdos] == ["8 DI data"]


def test_a_command_of_the_device_gives_way_to_a_module() -> None:
    esi = coupler()
    assert esi.mailbox is not None
    kept = EsiInitCommand(("PS",), 0x8001, 0, b"\x01")
    own = (EsiInitCommand(("PS",), 0x8000, 1, b"\x01", overwritten_by_module=True), kept)
    device = described(replace(esi, mailbox=replace(esi.mailbox, init_commands=own)))
    assert [(each.index, each.data) for each in device.init_commands] == [
        (0x8001, b"\x01"),
        (0x8000, b"\x05\x00"),
    ]


def test_requested_modules_replace_the_reported_ones() -> None:
    esi = coupler()
    device = described(esi, detected=(DI, 0, 0), configured=(DI, 0, 0))
    plan = planned(device, esi, ["8 DO", None, "4 AI"])
    [one] = plan.devices
    assert [pdo.index for each in one.outputs for pdo in each.pdos] == [0x1600]
    assert [pdo.index for each in one.inputs for pdo in each.pdos] == [0x1AFF, 0x1A02]
    assert one.modules is not None
    assert [(each.index, each.subindex, each.data) for each in one.modules.downloads] == [
        (0xF030, 0, b"\x00"),
        (0xF030, 1, b"\x22\x00\x00\x00"),
        (0xF030, 2, bytes(4)),
        (0xF030, 3, b"\x33\x00\x00\x00"),
        (0xF030, 0, b"\x03"),
    ]
    text = str(plan)
    assert "slot 2 (Terminals 3): 4 AI (0x00000033), PDOs 0x1A02, objects + 0x20" in text
    assert "0x1C13  0x1AFF, 0x1A00 → 0x1AFF, 0x1A02" in text
    assert "modules.xml:51" in text


def test_the_list_is_not_written_without_need() -> None:
    esi = coupler()
    device = described(esi, detected=(DI, 0, 0), configured=(DI, 0, 0))
    assert planned(device, esi, ["8 DI"]).devices[0].downloads == (
        *planned(device, esi, ["8 DI"]).devices[0].commands.in_pre_op,
    )
    for lists in ({}, {"configured": (0, 0)}):  # nothing is known, so the defaults are not written
        unread = make_plan([described(esi, **lists)]).devices[0].modules  # type: ignore[arg-type]
        assert unread is not None
        assert unread.downloads == ()


def test_an_unknown_module_stays_in_the_list() -> None:
    lists = {"detected": (DI, 0x99, 0), "configured": (DI, 0x99, 0)}
    device = described(coupler(), **lists)
    assert any("0x00000099, which its ESI does not describe" in note for note in device.notes)
    plan = make_plan([device]).devices[0].modules
    assert plan is not None
    assert plan.downloads == ()
    assert ident_difference(plan, (DI, 0x99, 0)) == ""


def test_the_esi_can_require_the_list() -> None:
    esi = coupler()
    assert esi.slots is not None
    esi = replace(esi, slots=replace(esi.slots, download_module_idents=True))
    device = described(esi, detected=(DI, 0), configured=(DI, 0))
    plan = make_plan([device]).devices[0].modules
    assert plan is not None
    assert [each.subindex for each in plan.downloads] == [0, 1, 2, 0]


def test_modules_need_a_modular_device() -> None:
    with pytest.raises(ConfigurationError, match="has no slots for modules"):
        with_requested_modules(plain(0), expand(coupler(), ["8 DI"]))


@pytest.mark.parametrize(
    ("detected", "difference"),
    [
        ((DI, 0, AI), ""),
        ((DI, 0, AI, 0, 0), ""),
        ((0, 0, 0), ""),  # it detects no modules
        ((DI, 0), "slot 2 (Terminals 3): expected 4 AI (0x00000033), found empty"),
        ((DI, DO, AI), "slot 1 (Terminals 2): expected empty, found 8 DO (0x00000022)"),
        (
            (0x99, 0, AI),
            "slot 0 (Terminals 1): expected 8 DI (0x00000011), "
            "found a module that its ESI does not describe (0x00000099)",
        ),
    ],
)
def test_detected_modules_are_compared_by_slot(detected: tuple[int, ...], difference: str) -> None:
    esi = coupler()
    plan = make_module_plan(described(esi), expand(esi, ["8 DI", None, "4 AI"]))
    assert plan is not None
    assert ident_difference(plan, detected) == difference


def test_a_device_without_modules_says_so() -> None:
    plan = make_module_plan(described(coupler()), ())
    assert plan is not None
    assert module_lines(plan) == ["modules as requested: none"]
