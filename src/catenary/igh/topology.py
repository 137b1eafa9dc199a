"""Plausibility of the delays that a kernel master has measured.

IgH measures them once, in its scan, from the times at which a frame passed each port on its way
out and back (`ec_master_calc_dc` in its master/master.c). In a closed ring the frame does not come
back: it reaches the backup interface. The port times are then those of an earlier frame, the delays
are noise, and the clocks agree with each other on a wrong time.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.errors import ConfigurationError
from catenary.igh.abi import SlaveInfo

DELAY_MAX_NS = 100_000  # from one clock to the next: a hundred devices without clocks between them
OPEN_RING = (
    "unplug the cable of the backup interface, `sudo ethercat rescan`, start the loop, plug it in; "
    "or let Catenary send the frames itself: MainDevice('eth0', 'eth1')"
)


def check_delays(devices: Sequence[SlaveInfo]) -> None:
    """Raise ConfigurationError if the delays between the clocks cannot be right."""
    for position, device in enumerate(devices):
        delay_ns = max(int(port.delay_to_next_dc) for port in device.ports)
        if delay_ns > DELAY_MAX_NS:
            raise ConfigurationError(
                f"dc=True: the master measured {delay_ns / 1e3:g} us from device {position} to the "
                f"next clock; {DELAY_MAX_NS / 1e3:g} us are the most that can be",
                hint=f"dmesg | grep EtherCAT says more. A closed ring does that: {OPEN_RING}",
            )
    found = ring_end(devices)
    if found is not None:
        position, port = found
        raise ConfigurationError(
            f"dc=True: port {port} of device {position} has a link that leads to no device: the "
            "segment is a closed ring, and the master measures no delays there",
            hint=OPEN_RING,
        )


def ring_end(devices: Sequence[SlaveInfo]) -> tuple[int, int] | None:
    """Return the position and port of a link that leads to no device; None without one.

    A segment of n devices is a tree: n - 1 links lead away from the MainDevice. The link that is
    too many is one of the last device, as the master sees it in `ec_master_calc_topology_rec`.
    """
    away = [
        (position, number)
        for position, device in enumerate(devices)
        for number, port in enumerate(device.ports)
        if number and port.link.link_up and not port.link.loop_closed
    ]
    return away[-1] if len(away) >= len(devices) > 0 else None
