"""Our conversations compared with recordings of another MainDevice (ethercrab)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from catenary.model.device import Assignment, MailboxLayout, Pdo
from catenary.model.topology import open_ports, tree
from catenary.plan.pdo_mapping import Mapping
from catenary.plan.start_up import mapping_downloads
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sdo import download, upload
from catenary.procedure.station import Station
from catenary.wire.capture import decode_capture
from catenary.wire.coe import DownloadRequest, UploadRequest, UploadResponse, decode_coe
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame
from catenary.wire.mailbox import decode_mailbox
from catenary.wire.register import DL_STATUS
from catenary.wire.sii import MailboxProtocol
from tests.procedure.player import play


class Exchange(NamedTuple):
    request: Datagram  # as written into the mailbox
    answer: Datagram  # as read from it


def returned(path: Path) -> Iterator[Datagram]:
    """Return all datagrams that devices have answered, in order."""
    for packet in decode_capture(path.read_bytes()).packets:
        frame = decode_frame(packet.data)
        if frame.has_passed_controller:
            yield from (d for d in frame.datagrams if d.working_counter == 1)


def exchanges(path: Path) -> list[Exchange]:
    mailboxes = [d for d in returned(path) if d.ado >= 0x1000 and len(d.data) >= 128]
    requests = [d for d in mailboxes if d.command is EcatCommand.FPWR]
    answers = [d for d in mailboxes if d.command is EcatCommand.FPRD]
    assert len(requests) == len(answers)
    return [Exchange(*pair) for pair in zip(requests, answers, strict=True)]


class Recorded:
    """Owner of a position in a recording. Each mailbox write must equal the next recorded one."""

    def __init__(self, conversation: list[Exchange]) -> None:
        self._conversation = iter(conversation)
        self._answer: bytes | None = None

    def __call__(self, request: Request) -> Reply:
        if request.address >> 16 == 0x0805:
            return Reply(b"\x00", 1)
        if request.address >> 16 == 0x080D:
            return Reply(b"\x08" if self._answer is not None else b"\x00", 1)
        if request.command is EcatCommand.FPWR:
            recorded = next(self._conversation)
            assert (request.address, request.data) == (
                recorded.request.address,
                recorded.request.data,
            )
            self._answer = recorded.answer.data
            return Reply(request.data, 1)
        assert self._answer is not None
        answer, self._answer = self._answer, None
        return Reply(answer, 1)


def channel(exchange: Exchange) -> MailboxChannel:
    request, answer = exchange
    layout = MailboxLayout(
        request.ado, len(request.data), answer.ado, len(answer.data), MailboxProtocol.COE
    )
    return MailboxChannel(Station(1, request.adp, "EK1914"), layout)


@pytest.mark.parametrize(
    "name", ["ecrab_replay-ek1914-el3004-configure", "ecrab_replay-ek1914-segmented-upload"]
)
def test_requests_and_answers_match_the_recording(shared_data: Path, name: str) -> None:
    recorded = exchanges(shared_data / "pcap" / f"{name}.pcapng")
    mailbox = channel(recorded[0])
    device = Recorded(recorded)
    for each in recorded:
        request = decode_coe(decode_mailbox(each.request.data).data)
        answer = decode_coe(decode_mailbox(each.answer.data).data)
        if isinstance(request, DownloadRequest):
            run = download(mailbox, request.index, request.subindex, request.data)
            assert play(run, device) is None
        else:
            assert isinstance(request, UploadRequest)
            assert isinstance(answer, UploadResponse)
            assert play(upload(mailbox, request.index, request.subindex), device) == answer.data


def test_an_assignment_is_written_as_recorded(shared_data: Path) -> None:
    recorded = exchanges(shared_data / "pcap" / "ecrab_replay-ek1914-el3004-configure.pcapng")
    requests = [decode_coe(decode_mailbox(each.request.data).data) for each in recorded]
    written = [
        (r.index, r.subindex, r.data)
        for r in requests
        if isinstance(r, DownloadRequest) and r.index == 0x1C13
    ]
    pdos = tuple(Pdo(index, (), 3) for index in (0x1A00, 0x1A02, 0x1A04, 0x1A06))
    ours = mapping_downloads(Mapping((Assignment(3, pdos),), reassigned=(3,)))
    assert [(d.index, d.subindex, d.data) for d in ours] == written


def test_the_tree_of_a_recorded_line(shared_data: Path) -> None:
    path = shared_data / "pcap" / "ecrab_replay-dc.pcapng"
    found: dict[int, int] = {}
    for datagram in returned(path):
        if datagram.ado == DL_STATUS.address and len(datagram.data) == DL_STATUS.size:
            found[datagram.adp] = DL_STATUS.unpack(datagram.data)
    assert len(found) == 3  # EK1100, EL2828, EL2889
    places = tree([open_ports(word) for _, word in sorted(found.items())])
    assert [place.parent for place in places] == [None, 0, 1]
