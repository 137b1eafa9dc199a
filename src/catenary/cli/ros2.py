"""`catenary ros2 SHARE`: a running loop as a node of a ROS 2 graph."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import number, share_name
from catenary.cli.parsers import Commands, add_command, add_uid
from catenary.cli.record import stopped_by_signals

if TYPE_CHECKING:
    from catenary.ros2.config import Config


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "ros2",
        help="connect a running loop to a ROS 2 graph",
        description="Publishes the joints, sensors and diagnostics of a loop from its share "
        "(Loop(..., sink=cat.Share(NAME))), and accepts trajectories and set-points. Needs "
        "catenary[ros2] or a sourced ROS 2 installation. Ends on Ctrl-C: the axes hold, and "
        "torques become 0.",
        example="catenary ros2 arm\ncatenary ros2 arm --config ros2.toml --domain 7",
    )
    parser.add_argument("share", metavar="SHARE", type=share_name, help="name of the loop's share")
    parser.add_argument("--config", type=Path, help="configuration file (docs/how_to/ros2.md)")
    parser.add_argument("--domain", type=number, help="ROS domain (default: $ROS_DOMAIN_ID, or 0)")
    parser.add_argument("--namespace", help="namespace of the node, such as /left")
    parser.add_argument(
        "--backend", choices=("auto", "cyclone", "rclpy"), help="default: rclpy where it is found"
    )
    add_uid(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.ros2.backend import open_backend
    from catenary.ros2.bridge import Bridge

    config = read(arguments)
    backend = open_backend(
        config.node, namespace=config.namespace, domain=config.domain, kind=config.backend
    )
    bridge = Bridge(arguments.share, backend, config, uid=arguments.uid)
    with stopped_by_signals() as stop, bridge:
        where = f"{config.namespace.rstrip('/')}/{config.node}"
        print(f"{where} by {backend.name}; press Ctrl-C to stop", flush=True)
        bridge.run(stop, show=lambda text: print(f"note: {text}", flush=True))
    return 0


def read(arguments: argparse.Namespace) -> Config:
    """Return the configuration of the file, overridden by the command line."""
    from catenary.ros2.config import Config
    from catenary.ros2.config_file import make_config, read_config

    config = read_config(arguments.config) if arguments.config is not None else Config()
    given = {name: getattr(arguments, name) for name in ("domain", "namespace", "backend")}
    changed = {name: value for name, value in given.items() if value is not None}
    make_config(changed, Path("command line"))
    from msgspec.structs import replace

    return replace(config, **changed)
