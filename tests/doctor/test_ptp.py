"""Checks of PTP: outputs of pmc 3.1.1, and daemons that set the same clock."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from catenary.doctor.examination import examine
from catenary.doctor.ptp import daemons, synchronisation, system_clock, tai
from catenary.doctor.ptp_state import PtpState, parse_ptp_state, read_ptp_state
from tests.doctor.machines import STEADY, make

# Output of pmc 3.1.1 for a port that listens. In SLAVE the first lines differ as given.
LISTENING = """sending: GET TIME_STATUS_NP
sending: GET TIME_PROPERTIES_DATA_SET
sending: GET PORT_DATA_SET
\t72956a.fffe.c3775a-0 seq 0 RESPONSE MANAGEMENT TIME_STATUS_NP
\t\tmaster_offset              0
\t\tingress_time               0
\t\tcumulativeScaledRateOffset +0.000000000
\t\tlastGmPhaseChange          0x0000'0000000000000000.0000
\t\tgmPresent                  false
\t\tgmIdentity                 72956a.fffe.c3775a
\t72956a.fffe.c3775a-0 seq 1 RESPONSE MANAGEMENT TIME_PROPERTIES_DATA_SET
\t\tcurrentUtcOffset      37
\t\tleap61                0
\t\tcurrentUtcOffsetValid 0
\t\tptpTimescale          0
\t72956a.fffe.c3775a-1 seq 2 RESPONSE MANAGEMENT PORT_DATA_SET
\t\tportIdentity            72956a.fffe.c3775a-1
\t\tportState               LISTENING
\t\tlogMinDelayReqInterval  0
"""
SLAVE = (
    LISTENING.replace("master_offset              0", "master_offset              -1250")
    .replace("gmPresent                  false", "gmPresent                  true")
    .replace("currentUtcOffsetValid 0", "currentUtcOffsetValid 1")
    .replace("LISTENING", "SLAVE")
)
PHC2SYS = "/usr/sbin/phc2sys"


def test_the_output_of_pmc() -> None:
    assert parse_ptp_state(LISTENING) == PtpState(("LISTENING",))
    state = parse_ptp_state(SLAVE)
    assert state == PtpState(("SLAVE",), pytest.approx(-1.25e-6), True, 37)  # type: ignore[arg-type]


def test_no_answer() -> None:
    assert parse_ptp_state("sending: GET TIME_STATUS_NP\n") is None
    assert parse_ptp_state("") is None


@pytest.mark.parametrize(
    ("state", "status", "text"),
    [
        (PtpState(("SLAVE",), -1.25e-6, True), "PASS", "-1.250 us"),
        (PtpState(("SLAVE",), 25e-6, True), "WARN", "more than 10 us"),
        (PtpState(("MASTER",)), "PASS", "grandmaster"),
        (PtpState(("LISTENING",)), "FAIL", "LISTENING"),
        (PtpState(("UNCALIBRATED",), 0.5, True), "FAIL", "UNCALIBRATED"),
        (PtpState(("MASTER", "FAULTY")), "FAIL", "FAULTY"),
        (PtpState(("MASTER", "SLAVE"), 1e-7, True), "PASS", "+0.100 us"),  # a boundary clock
        (None, "SKIP", "does not answer"),
    ],
)
def test_the_offset(tmp_path: Path, state: PtpState | None, status: str, text: str) -> None:
    check = synchronisation(make(tmp_path, {}, ptp=state))
    assert (check.status, text in check.found) == (status, True)


def processes(*commands: str) -> dict[str, str]:
    files = {}
    for number, command in enumerate(commands, 100):
        words = command.split()
        files[f"/proc/{number}/comm"] = words[0].rpartition("/")[2][:15]
        files[f"/proc/{number}/cmdline"] = "\0".join(words)
    return files


@pytest.mark.parametrize(
    ("commands", "status"),
    [
        (("bash",), "PASS"),
        ((), "SKIP"),
        (("chronyd",), "PASS"),
        (("ptp4l -i eth1", f"{PHC2SYS} -a -r"), "PASS"),
        (("ptp4l -i eth1", f"{PHC2SYS} -a -r", "systemd-timesyncd"), "FAIL"),
        (("ptp4l -i eth1 -S", "ntpd -g"), "FAIL"),
        (("ptp4l -i eth1", "chronyd"), "PASS"),  # chrony may use the PHC
        (("chronyd", f"{PHC2SYS} -s CLOCK_REALTIME -c eth1"), "PASS"),  # a grandmaster with NTP
        (("chronyd", f"{PHC2SYS} -s eth1"), "FAIL"),
        (("chronyd", f"{PHC2SYS} -s eth1 -c CLOCK_REALTIME -w"), "FAIL"),
        (("chronyd", f"{PHC2SYS} -s eth1 -c eth2"), "PASS"),
        (("chronyd", f"{PHC2SYS} -a"), "PASS"),
        (("chronyd", f"{PHC2SYS} -a -rr"), "FAIL"),
        (("chronyd", f"{PHC2SYS} -s eth1 -E ntpshm"), "PASS"),
        (("timemaster", "chronyd", f"{PHC2SYS} -a -r"), "PASS"),
        (("chronyd", "systemd-timesyncd"), "FAIL"),
    ],
)
def test_two_programs_that_set_the_same_clock(
    tmp_path: Path, commands: tuple[str, ...], status: str
) -> None:
    assert daemons(make(tmp_path, processes(*commands))).status == status


def test_the_advice_keeps_ptp(tmp_path: Path) -> None:
    commands = ("ptp4l -i eth1", f"{PHC2SYS} -a -r", "systemd-timesyncd")
    assert "disable --now systemd-timesyncd" in daemons(make(tmp_path, processes(*commands))).advice


@pytest.mark.parametrize(
    ("commands", "status"),
    [
        (("ptp4l -i eth1",), "WARN"),
        (("ptp4l -i eth1", f"{PHC2SYS} -a -r"), "PASS"),
        (("ptp4l -i eth1 -S",), "PASS"),
        (("ptp4l -i eth1", "chronyd"), "PASS"),
        (("ptp4l -i eth1", "timemaster"), "PASS"),
    ],
)
def test_the_system_clock(tmp_path: Path, commands: tuple[str, ...], status: str) -> None:
    assert system_clock(make(tmp_path, processes(*commands))).status == status


@pytest.mark.parametrize(
    ("options", "clock", "others"),
    [
        ("-a -r -r", "PASS", "PASS"),  # the card follows CLOCK_REALTIME, which NTP may set
        ("-arr", "PASS", "PASS"),
        ("-a -r", "FAIL", "FAIL"),
        ("-w -s eth1", "FAIL", "FAIL"),  # the unit phc2sys@ of Debian
    ],
)
def test_a_grandmaster_must_not_follow_its_card(
    tmp_path: Path, options: str, clock: str, others: str
) -> None:
    files = processes("ptp4l -i eth1", f"{PHC2SYS} {options}", "chronyd")
    machine = make(tmp_path, files, ptp=PtpState(("MASTER",)))
    assert (system_clock(machine).status, daemons(machine).status) == (clock, others)


@pytest.mark.parametrize(
    ("here", "ptp", "status"),
    [(37, 37, "PASS"), (37, None, "PASS"), (0, None, "WARN"), (0, 37, "FAIL"), (36, 37, "FAIL")],
)
def test_the_offset_of_tai(tmp_path: Path, here: int, ptp: int | None, status: str) -> None:
    state = PtpState(("SLAVE",), 0.0, True, ptp)
    machine = make(tmp_path, {}, ptp=state, clock=replace(STEADY, tai_offset=here))
    assert tai(machine).status == status


def test_a_machine_with_ptp_has_its_own_group(tmp_path: Path) -> None:
    titles = [title for title, _ in examine(make(tmp_path, processes("ptp4l -i eth1"))).groups]
    assert "time of several machines" in titles
    titles = [title for title, _ in examine(make(tmp_path / "other", {})).groups]
    assert "time of several machines" not in titles


PTP4L = shutil.which("ptp4l", path=f"{os.environ.get('PATH', '')}:/usr/sbin")


@pytest.mark.skipif(PTP4L is None, reason="linuxptp is not installed")
def test_a_real_ptp4l(tmp_path: Path, veth: tuple[str, str]) -> None:
    """One ptp4l without a peer becomes the grandmaster. `free_running` leaves all clocks alone."""
    assert PTP4L is not None
    socket = tmp_path / "ptp4l"
    configuration = tmp_path / "ptp4l.conf"
    configuration.write_text(
        "[global]\ntime_stamping software\nfree_running 1\nnetwork_transport L2\n"
        f"logAnnounceInterval -3\nuds_address {socket}\n"
    )
    process = subprocess.Popen(
        [PTP4L, "-f", str(configuration), "-i", veth[0]], stdout=subprocess.DEVNULL
    )
    try:
        deadline = time.monotonic() + 30.0
        state = None
        while time.monotonic() < deadline and (state is None or state.ports != ("MASTER",)):
            assert process.poll() is None, "ptp4l has ended"
            state = read_ptp_state(str(socket))
            time.sleep(0.1)
        assert state == PtpState(("MASTER",))
    finally:
        process.terminate()
        process.wait()


def test_no_socket(tmp_path: Path) -> None:
    assert read_ptp_state(str(tmp_path / "none")) is None
