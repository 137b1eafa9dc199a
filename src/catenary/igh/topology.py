"""Plausibility check of the delays that a kernel master has measured.

IgH measures them once, in its scan, from the times at which a frame passed each port in both
directions (`ec_master_calc_dc` in its master/master.c). In a closed ring, the frame does not return
but reaches the backup interface. The port times are then those of an earlier frame, and the delays
are random. The clocks then agree with each other, but on a wrong time.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.errors import ConfigurationError
from catenary.igh.abi import SlaveInfo

DELAY_MAX_NS = (
    100_000  # between two clocks, even with a hundred devices without clocks between them
)
OPEN_RING = (
    "unplug the cable of the backup interface, run `sudo ethercat rescan`, start the loop, and "
    "plug the cable in again; or let Catenary send the frames itself: MainDevice('eth0', 'eth1')"
)


def check_delays(devices: Sequence[SlaveInfo]) -> None:
    """Check the delays between the clocks.

    Raises:
        ConfigurationError: A delay is implausible, or the segment is a closed ring.
    """
    for position, device in enumerate(devices):
        delay_ns = max(int(port.delay_to_next_dc) for port in device.ports)
        if delay_ns > DELAY_MAX_NS:
            raise ConfigurationError(
                f"dc=True: the master measured {delay_ns / 1e3:g} us from device {position} to the "
                f"next clock; at most {DELAY_MAX_NS / 1e3:g} us are plausible",
                hint=f"see dmesg | grep EtherCAT. A closed ring is a possible cause: {OPEN_RING}",
            )
    found = ring_end(devices)
    if found is not None:
        position, port = found
        raise ConfigurationError(
            f"dc=True: port {port} of device {position} has a link that leads to no device: the "
            "segment is a closed ring, in which the master cannot measure delays",
            hint=OPEN_RING,
        )


def ring_end(devices: Sequence[SlaveInfo]) -> tuple[int, int] | None:
    """Return the position and port of a link that leads to no device; None if there is none.

    A segment of n devices is a tree: n - 1 links lead away from the MainDevice. A surplus link
    belongs to the last device, as in the master's `ec_master_calc_topology_rec`.
    """
    away = [
        (position, number)
        for position, device in enumerate(devices)
        for number, port in enumerate(device.ports)
        if number and port.link.link_up and not port.link.loop_closed
    ]
    return away[-1] if len(away) >= len(devices) > 0 else None
