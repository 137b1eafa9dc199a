"""`catenary capture`: captures of EtherCAT traffic, from Wireshark, tcpdump or Catenary."""

from __future__ import annotations

from catenary.cli import capture_diff, capture_record, capture_sdo, capture_show
from catenary.cli.parsers import Commands, add_command


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "capture",
        help="explain captures of any master (pcapng, pcap)",
        description="Explains captures of EtherCAT traffic, of any master: files in pcapng or pcap "
        "format, from Wireshark, tcpdump, TwinCAT or Catenary.",
        example="catenary capture show twincat.pcapng",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    capture_show.add_to(group)
    capture_diff.add_to(group)
    capture_sdo.add_to(group)
    capture_record.add_to(group)
