"""Checks of the network card: its driver, its settings, and other traffic on its port."""

from __future__ import annotations

import re

from catenary.doctor.card import ARPHRD_ETHER, SPEED_UNKNOWN, Card
from catenary.doctor.change import ETHTOOL, Change
from catenary.doctor.check import Check, failed, passed, skipped, warned
from catenary.doctor.machine import Machine

ETHERCAT_SPEED = 100  # [Mbit/s] full duplex, ETG.1000.2
GOOD_DRIVERS = {
    "igb": "Intel i210, i350",
    "igc": "Intel i225, i226",
    "e1000": "Intel",
    "stmmac": "Synopsys",
    "genet": "Raspberry Pi 4",
    "bcmgenet": "Raspberry Pi 4",
    "macb": "Cadence",
    "fec": "NXP",
}
DOUBTFUL_DRIVERS = {
    "e1000e": "good with the 82574L; users report late frames with the I219 of many laptops",
    "r8169": "works with occasional late frames; disable EEE and interrupt moderation",
    "tg3": "little is known about its use with EtherCAT",
    "virtio_net": "a virtual card: all frames pass through the host's software",
    "vmxnet3": "a virtual card: all frames pass through the host's software",
    "xen_netfront": "a virtual card: all frames pass through the host's software",
}
VIRTUAL_DRIVERS = {"veth", "tun", "dummy", "bridge", "bonding", "macvlan", "macvtap", "team"}
NEIGHBOURS = ("lldpd", "avahi-daemon", "dhcpcd", "dhclient", "snmpd", "ladvd")


def directory(card: Card) -> str:
    return f"/sys/class/net/{card.name}"


def is_virtual(machine: Machine, card: Card) -> bool:
    """Return True if the interface has no hardware.

    Return False if /sys lacks the interface, because it may show another network namespace.
    """
    if card.driver in VIRTUAL_DRIVERS:
        return True
    return machine.exists(directory(card)) and not machine.exists(f"{directory(card)}/device")


def driver(machine: Machine, card: Card) -> Check:
    id, place = "nic-driver", directory(card)
    name = card.driver or "unknown driver"
    if card.hardware_type != ARPHRD_ETHER:
        text = f"{card.name} is not an Ethernet card (ARPHRD type {card.hardware_type})"
        return failed(id, text, "use a wired card")
    if machine.exists(f"{place}/wireless") or machine.exists(f"{place}/phy80211"):
        return failed(
            id, f"{card.name} is wireless ({name})", "use a wired card: Intel i210 or i226"
        )
    if is_virtual(machine, card):
        return warned(
            id,
            f"{name}: a software interface without a card",
            "use it for virtual segments only; real devices need a wired card",
        )
    if card.bus.startswith("usb"):
        return warned(
            id,
            f"{name}, on USB: the bus delays frames by 125 us or more",
            "use a PCI Express card: Intel i210 or i226",
        )
    if name in GOOD_DRIVERS:
        return passed(id, f"{name} ({GOOD_DRIVERS[name]}) at {card.bus}")
    why = DOUBTFUL_DRIVERS.get(name, "not in the list of tested drivers")
    return warned(
        id, f"{name}: {why}", "measure it; good cards are Intel i210 (igb) and i226 (igc)"
    )


def link(machine: Machine, card: Card) -> Check:
    id = "nic-link"
    if not card.up:
        return failed(id, f"{card.name} is down", f"sudo ip link set {card.name} up")
    if not card.running:
        return failed(id, "no link", "check the cable and the power of the first device")
    if is_virtual(machine, card):
        return passed(id, "up, without a cable")
    if card.link is None or card.link.speed == SPEED_UNKNOWN:
        return skipped(id, f"up; {card.refusals.get('link', 'speed unknown')}")
    speed, full = card.link.speed, card.link.full_duplex
    text = f"{speed} Mbit/s, {'full' if full else 'unknown' if full is None else 'half'} duplex"
    if speed < ETHERCAT_SPEED or full is False:
        return failed(
            id,
            f"{text}, but EtherCAT needs {ETHERCAT_SPEED} Mbit/s full duplex",
            f"replace the cable; sudo ethtool -s {card.name} autoneg on",
        )
    if speed > ETHERCAT_SPEED:
        return warned(
            id,
            f"{text}: the other end is not an EtherCAT device, which has {ETHERCAT_SPEED} Mbit/s",
            "connect the cable to IN of the first device, without a switch",
        )
    return passed(id, text)


def use(machine: Machine, card: Card) -> Check:
    """Check for other use of the port: /proc/net/route lists the IPv4 routes in hexadecimal."""
    id = "nic-use"
    lines = (machine.text("/proc/net/route") or "").splitlines()[1:]
    routes = [words[1] for line in lines if (words := line.split()) and words[0] == card.name]
    if "00000000" in routes:
        return failed(
            id,
            f"{card.name} has the default route of this machine",
            "use a separate port for EtherCAT",
        )
    if machine.exists(f"{directory(card)}/master"):
        return warned(
            id, "the port is part of a bridge or bond", f"sudo ip link set {card.name} nomaster"
        )
    if routes:
        return warned(
            id,
            "the port has an IPv4 address, so the kernel sends ARP and other frames",
            f"sudo ip address flush dev {card.name}",
        )
    return passed(id, "no route uses the port")


def managed(machine: Machine, card: Card) -> Check:
    id = "nic-managed"
    managers = []
    manager = machine.text(f"/run/NetworkManager/devices/{card.index}") or ""
    if "NetworkManager" in machine.processes and not re.search(r"managed=(false|0)", manager):
        managers.append("NetworkManager")
    networkd = machine.text(f"/run/systemd/netif/links/{card.index}") or "ADMIN_STATE=unmanaged"
    if "systemd-network" in machine.processes and "ADMIN_STATE=unmanaged" not in networkd:
        managers.append("systemd-networkd")
    neighbours = [name for name in NEIGHBOURS if name in machine.processes]
    if not managers and not neighbours:
        return passed(id, "no running program is known to send on the port")
    advice = {
        "NetworkManager": f"sudo nmcli device set {card.name} managed no # until the next reboot",
        "systemd-networkd": f"printf '[Match]\\nName={card.name}\\n\\n[Link]\\nUnmanaged=yes\\n' "
        "| sudo tee /etc/systemd/network/10-ethercat.network; sudo networkctl reload",
    }
    commands = [advice[name] for name in managers]
    if neighbours:
        commands.append(f"exclude {card.name} from {' and '.join(neighbours)}")
    return warned(
        id,
        f"{', '.join([*managers, *neighbours])} may send DHCP, mDNS or LLDP frames on the port",
        "; ".join(commands),
    )


def traffic(machine: Machine, card: Card) -> Check:
    """Check for frames that other programs sent during the measurement."""
    id = "nic-traffic"
    if machine.sent is None or not machine.watched:
        return skipped(id, "not measured", f"catenary doctor {card.name} --seconds 60")
    if machine.sent == 0:
        return passed(id, f"no frame was sent in {machine.watched:g} s")
    return warned(
        id,
        f"other programs sent {machine.sent} frames in {machine.watched:g} s",
        f"sudo tcpdump -eni {card.name} -Q out # shows the frames",
    )


def ipv6(machine: Machine, card: Card) -> Check:
    id = "nic-ipv6"
    path = f"/proc/sys/net/ipv6/conf/{card.name}/disable_ipv6"
    off = machine.number(path)
    if off is None:
        return passed(id, "the kernel has no IPv6 on the port")
    if off == 1:
        return passed(id, "off")
    lines = (machine.text("/proc/net/if_inet6") or "").splitlines()
    scopes = [words[3] for line in lines if (words := line.split())[-1] == card.name]
    own = all(scope == "20" for scope in scopes)  # the kernel itself restores link-local addresses
    return warned(
        id,
        "on: the kernel sends router solicitations and multicast reports",
        f"sudo sysctl net.ipv6.conf.{card.name}.disable_ipv6=1",
        (Change(path, "1"),) if own else (),
    )


def eee(machine: Machine, card: Card) -> Check:
    id = "nic-eee"
    if card.eee is None:
        return passed(id, f"the driver does not support it ({card.refusals.get('eee', 'unknown')})")
    if not card.eee.enabled:
        return passed(id, "off")
    return warned(
        id,
        "energy-efficient Ethernet is on"
        + (" and active: waking the link takes about 20 us" * card.eee.active),
        f"sudo ethtool --set-eee {card.name} eee off",
        (Change(f"{ETHTOOL}{card.name}/eee", "0"),),
    )


def coalescing(machine: Machine, card: Card) -> Check:
    id, now = "nic-coalescing", card.coalescing
    if now is None:
        return skipped(id, f"the driver does not report it ({card.refusals.get('coalescing', '')})")
    if now.rx_usecs == 0 and not now.adaptive_rx:
        return passed(id, "the card raises an interrupt for each frame without delay")
    place = f"{ETHTOOL}{card.name}"
    changes = [Change(f"{place}/adaptive-rx", "0")] * now.adaptive_rx
    changes += [Change(f"{place}/rx-usecs", "0")] * (now.rx_usecs != 0)
    adaptive = " adaptive-rx off" * now.adaptive_rx
    return warned(
        id,
        f"the card delays received frames: rx-usecs {now.rx_usecs}"
        + ", adaptive" * now.adaptive_rx,
        f"sudo ethtool -C {card.name}{adaptive} rx-usecs 0",
        tuple(changes),
    )


def offloads(machine: Machine, card: Card) -> Check:
    """Check software interrupt coalescing and LRO, Documentation/networking/napi.rst."""
    id, place = "nic-offloads", directory(card)
    timers = {
        path: value
        for name in ("gro_flush_timeout", "napi_defer_hard_irqs")
        if (value := machine.number(path := f"{place}/{name}") or 0) > 0
    }
    if timers:
        text = ", ".join(f"{path.rpartition('/')[2]} {value}" for path, value in timers.items())
        return warned(
            id,
            f"the kernel polls for received frames by a timer: {text}",
            "; ".join(f"echo 0 | sudo tee {path}" for path in timers),
            tuple(Change(path, "0") for path in timers),
        )
    if card.lro:
        return warned(
            id,
            "the card merges received frames (LRO)",
            f"sudo ethtool -K {card.name} lro off",
        )
    return passed(
        id, "GRO is on, but does not affect EtherCAT frames" if card.gro else "none is active"
    )


CHECKS = (driver, link, use, managed, traffic, ipv6, eee, coalescing, offloads)
