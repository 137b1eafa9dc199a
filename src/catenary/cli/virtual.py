"""`catenary virtual serve NIC`: serve a virtual segment on a network interface."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import fifo_priority, seconds
from catenary.cli.parsers import Commands, add_command


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "virtual",
        help="serve a segment of virtual devices",
        description="Serves a virtual segment that any EtherCAT MainDevice can use.",
        example="catenary virtual serve veth1 --config machine.toml",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_serve(group)


def _add_serve(group: Commands) -> None:
    parser = add_command(
        group,
        "serve",
        help="serve a segment on a network interface",
        description="Serves a virtual segment on a network interface until Ctrl-C. "
        "Without --config, serves the segment of the demo (coupler, digital output, three servos, "
        "digital output).",
        example="ip link add veth0 type veth peer name veth1\n"
        "ip link set veth0 up && ip link set veth1 up\n"
        "catenary virtual serve veth1 --priority 80 &\n"
        "catenary scan veth0",
    )
    parser.add_argument("interface", metavar="NIC", help="network interface of the segment")
    parser.add_argument(
        "--ring",
        metavar="NIC2",
        help="second interface, which closes the ring for cable redundancy",
    )
    parser.add_argument(
        "--config", metavar="FILE.toml", help="file with the devices of the segment"
    )
    parser.add_argument(
        "--priority",
        type=fifo_priority,
        metavar="N",
        help="run at SCHED_FIFO priority N (1 to 99) with locked memory",
    )
    parser.add_argument(
        "--max-age",
        type=seconds,
        default=2e-3,
        metavar="S",
        help="drop frames that waited longer than S seconds, because a cable does not store "
        "frames (0.002)",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.virtual import FaultEvent, demo_segment, read_segment, serve

    if arguments.priority is not None:
        _raise_priority(arguments.interface, arguments.priority)
    ring = arguments.ring is not None
    if arguments.config is None:
        segment = demo_segment(clock="monotonic", ring=ring)
    else:
        segment = read_segment(arguments.config, clock="monotonic", ring=ring)
    interfaces = f"{arguments.interface} and {arguments.ring}" if ring else arguments.interface

    def say() -> None:
        print(f"serving {len(segment)} devices on {interfaces}; press Ctrl-C to stop", flush=True)

    def print_fault(event: FaultEvent) -> None:
        print(f"{event.time:.3f} s: {event.fault} {event.what}", flush=True)

    serve(
        segment,
        arguments.interface,
        second=arguments.ring,
        max_age=arguments.max_age,
        ready=say,
        on_fault=print_fault,
    )
    _report_expired(segment.frames.expired, arguments.max_age, arguments.priority)
    return 0


def _raise_priority(interface: str, priority: int) -> None:
    """Request real-time scheduling for this process and its later threads."""
    from catenary.errors import LinkError
    from catenary.interpreter import permission_advice
    from catenary.realtime.system.scheduling import request_scheduling

    scheduling = request_scheduling(priority=priority)
    if not scheduling.real_time:
        refused = "; ".join(scheduling.refusals)
        raise LinkError(
            f"cannot serve {interface} in real time: {refused}", hint=permission_advice()
        )


def _report_expired(frames: int, max_age: float, priority: int | None) -> None:
    if frames:
        advice = "" if priority else "; --priority 80 makes this less frequent"
        print(f"{frames} frames waited longer than {max_age * 1e3:g} ms and were dropped{advice}")
