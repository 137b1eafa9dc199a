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
    "e1000e": "good with the 82574L; with the I219 of many laptops users report late answers",
    "r8169": "works, with late answers now and then; its EEE and interrupt moderation off",
    "tg3": "not much is known of it with EtherCAT",
    "virtio_net": "the host's software stands between it and any cable",
    "vmxnet3": "the host's software stands between it and any cable",
    "xen_netfront": "the host's software stands between it and any cable",
}
VIRTUAL_DRIVERS = {"veth", "tun", "dummy", "bridge", "bonding", "macvlan", "macvtap", "team"}
NEIGHBOURS = ("lldpd", "avahi-daemon", "dhcpcd", "dhclient", "snmpd", "ladvd")


def directory(card: Card) -> str:
    return f"/sys/class/net/{card.name}"


def is_virtual(machine: Machine, card: Card) -> bool:
    """Return True if no hardware is behind the interface.

    /sys may belong to another network namespace and lack the interface.
    """
    if card.driver in VIRTUAL_DRIVERS:
        return True
    return machine.exists(directory(card)) and not machine.exists(f"{directory(card)}/device")


def driver(machine: Machine, card: Card) -> Check:
    id, place = "nic-driver", directory(card)
    name = card.driver or "no driver named"
    if card.hardware_type != ARPHRD_ETHER:
        words = f"{card.name} is not an Ethernet card (ARPHRD type {card.hardware_type})"
        return failed(id, words, "a wired card")
    if machine.exists(f"{place}/wireless") or machine.exists(f"{place}/phy80211"):
        return failed(id, f"{card.name} is wireless ({name})", "a wired card: Intel i210 or i226")
    if is_virtual(machine, card):
        return warned(
            id, f"{name}: not a card but software", "good for virtual segments; else a real card"
        )
    if card.bus.startswith("usb"):
        return warned(
            id,
            f"{name}, on USB: frames wait for the bus, 125 us and more",
            "a PCI Express card: Intel i210 or i226",
        )
    if name in GOOD_DRIVERS:
        return passed(id, f"{name} ({GOOD_DRIVERS[name]}) at {card.bus}")
    why = DOUBTFUL_DRIVERS.get(name, "not known to this list")
    return warned(
        id, f"{name}: {why}", "measure it; known to be good: Intel i210 (igb), i226 (igc)"
    )


def link(machine: Machine, card: Card) -> Check:
    id = "nic-link"
    if not card.up:
        return failed(id, f"{card.name} is down", f"sudo ip link set {card.name} up")
    if not card.running:
        return failed(id, "no link", "cable plugged in, first device powered?")
    if is_virtual(machine, card):
        return passed(id, "up, without a cable")
    if card.link is None or card.link.speed == SPEED_UNKNOWN:
        return skipped(id, f"up; {card.refusals.get('link', 'speed unknown')}")
    speed, full = card.link.speed, card.link.full_duplex
    words = f"{speed} Mbit/s, {'full' if full else 'unknown' if full is None else 'half'} duplex"
    if speed < ETHERCAT_SPEED or full is False:
        return failed(
            id,
            f"{words}: EtherCAT needs {ETHERCAT_SPEED} Mbit/s full duplex",
            f"another cable; sudo ethtool -s {card.name} autoneg on",
        )
    if speed > ETHERCAT_SPEED:
        return warned(
            id,
            f"{words}: EtherCAT devices have {ETHERCAT_SPEED}, so the other end is not one",
            "plug the cable into IN of the first device, without a switch",
        )
    return passed(id, words)


def use(machine: Machine, card: Card) -> Check:
    """Check for other use: /proc/net/route has a line for each IPv4 route, in hexadecimal."""
    id = "nic-use"
    lines = (machine.text("/proc/net/route") or "").splitlines()[1:]
    routes = [words[1] for line in lines if (words := line.split()) and words[0] == card.name]
    if "00000000" in routes:
        return failed(
            id,
            f"{card.name} is this machine's way to the network (default route)",
            "EtherCAT needs a port of its own",
        )
    if machine.exists(f"{directory(card)}/master"):
        return warned(id, "part of a bridge or bond", f"sudo ip link set {card.name} nomaster")
    if routes:
        return warned(
            id,
            "has an IPv4 address, so ARP and more go out between the frames",
            f"sudo ip address flush dev {card.name}",
        )
    return passed(id, "no route leads through it")


def managed(machine: Machine, card: Card) -> Check:
    id = "nic-managed"
    who = []
    manager = machine.text(f"/run/NetworkManager/devices/{card.index}") or ""
    if "NetworkManager" in machine.processes and not re.search(r"managed=(false|0)", manager):
        who.append("NetworkManager")
    networkd = machine.text(f"/run/systemd/netif/links/{card.index}") or "ADMIN_STATE=unmanaged"
    if "systemd-network" in machine.processes and "ADMIN_STATE=unmanaged" not in networkd:
        who.append("systemd-networkd")
    neighbours = [name for name in NEIGHBOURS if name in machine.processes]
    if not who and not neighbours:
        return passed(id, "no program seen that would send on it")
    advice = {
        "NetworkManager": f"sudo nmcli device set {card.name} managed no # until the next start",
        "systemd-networkd": f"`[Match] Name={card.name} [Link] Unmanaged=yes` in "
        "/etc/systemd/network/10-ethercat.network",
    }
    commands = [advice[name] for name in who]
    if neighbours:
        commands.append(f"have {' and '.join(neighbours)} leave {card.name} alone")
    return warned(
        id,
        f"{', '.join([*who, *neighbours])} may send on it: DHCP, mDNS, LLDP",
        "; ".join(commands),
    )


def traffic(machine: Machine, card: Card) -> Check:
    """Check the frames that were sent while the doctor sent none."""
    id = "nic-traffic"
    if machine.sent is None or not machine.watched:
        return skipped(id, "not watched", f"catenary doctor {card.name} --seconds 60")
    if machine.sent == 0:
        return passed(id, f"no frame went out in {machine.watched:g} s")
    return warned(
        id,
        f"{machine.sent} frames went out in {machine.watched:g} s, and none was the doctor's",
        f"sudo tcpdump -eni {card.name} -Q out # tells whose they are",
    )


def ipv6(machine: Machine, card: Card) -> Check:
    id = "nic-ipv6"
    path = f"/proc/sys/net/ipv6/conf/{card.name}/disable_ipv6"
    off = machine.number(path)
    if off is None:
        return passed(id, "the kernel has no IPv6 on it")
    if off == 1:
        return passed(id, "off")
    lines = (machine.text("/proc/net/if_inet6") or "").splitlines()
    scopes = [words[3] for line in lines if (words := line.split())[-1] == card.name]
    own = all(scope == "20" for scope in scopes)  # link-local: comes back by itself
    return warned(
        id,
        "on: the kernel itself sends router solicitations and multicast reports",
        f"sudo sysctl net.ipv6.conf.{card.name}.disable_ipv6=1",
        (Change(path, "1"),) if own else (),
    )


def eee(machine: Machine, card: Card) -> Check:
    id = "nic-eee"
    if card.eee is None:
        return passed(id, f"the driver has none ({card.refusals.get('eee', 'not asked')})")
    if not card.eee.enabled:
        return passed(id, "off")
    return warned(
        id,
        "energy-efficient Ethernet is on"
        + (" and agreed: waking the link takes about 20 us" * card.eee.active),
        f"sudo ethtool --set-eee {card.name} eee off",
        (Change(f"{ETHTOOL}{card.name}/eee", "0"),),
    )


def coalescing(machine: Machine, card: Card) -> Check:
    id, now = "nic-coalescing", card.coalescing
    if now is None:
        return skipped(id, f"the driver does not report it ({card.refusals.get('coalescing', '')})")
    if now.rx_usecs == 0 and not now.adaptive_rx:
        return passed(id, "every frame interrupts at once")
    place = f"{ETHTOOL}{card.name}"
    changes = [Change(f"{place}/adaptive-rx", "0")] * now.adaptive_rx
    changes += [Change(f"{place}/rx-usecs", "0")] * (now.rx_usecs != 0)
    adaptive = " adaptive-rx off" * now.adaptive_rx
    return warned(
        id,
        f"the card holds answers back: rx-usecs {now.rx_usecs}" + ", adaptive" * now.adaptive_rx,
        f"sudo ethtool -C {card.name}{adaptive} rx-usecs 0",
        tuple(changes),
    )


def offloads(machine: Machine, card: Card) -> Check:
    """Check Documentation/networking/napi.rst, "IRQ suspension", "Software IRQ coalescing"."""
    id, place = "nic-offloads", directory(card)
    waits = {
        path: value
        for name in ("gro_flush_timeout", "napi_defer_hard_irqs")
        if (value := machine.number(path := f"{place}/{name}") or 0) > 0
    }
    if waits:
        words = ", ".join(f"{path.rpartition('/')[2]} {value}" for path, value in waits.items())
        return warned(
            id,
            f"the kernel looks for frames by a timer rather than at once: {words}",
            "; ".join(f"echo 0 | sudo tee {path}" for path in waits),
            tuple(Change(path, "0") for path in waits),
        )
    if card.lro:
        return warned(
            id,
            "the card joins frames before it hands them over",
            f"sudo ethtool -K {card.name} lro off",
        )
    return passed(id, "GRO is on, and leaves EtherCAT frames alone" if card.gro else "none matters")


CHECKS = (driver, link, use, managed, traffic, ipv6, eee, coalescing, offloads)
