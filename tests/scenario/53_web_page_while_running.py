"""Two drives run at 1 kHz. One has an Ethernet port: the network stack of this machine pings it,
and a program on this machine reads its web page, through a TAP interface. The page arrives
complete, and both drives stay enabled.
"""

import hashlib
import socket
import urllib.request

import catenary as cat
from catenary.virtual import Coupler, Ethernet, Segment, Servo
from tests.virtual.ethernet_frames import ping, sum_of

SECONDS = 60.0  # generous: no time is measured
PAGE = "<h1>Drive</h1>" + "".join(f"<p>line {k}</p>" for k in range(8000))


def fetched(address: str) -> bytes:
    with urllib.request.urlopen(f"http://{address}/", timeout=SECONDS) as answer:
        assert answer.headers["Content-Length"] == str(len(PAGE))
        return bytes(answer.read())


def pinged(address: str, number: int, size: int) -> bytes:
    """Send an echo request through the network stack of this machine. Return the answer's data."""
    request = bytearray(ping(number, size)[34:])
    with socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_ICMP) as raw:
        raw.settimeout(SECONDS)
        raw.sendto(request, (address, 0))
        while True:
            answer = raw.recv(2000)
            if answer[20] == 0 and answer[24:28] == request[4:8]:
                assert sum_of(answer[20:]) == 0
                return answer[28:]


def test_ping_and_web_page_while_drives_run(tap: str) -> None:
    servo = Servo(mailbox_bytes=1024, protocols=[Ethernet(pages={"/": PAGE})])
    other = Servo()
    with cat.MainDevice(Segment([Coupler(), servo, other], clock="monotonic")) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm, period=1e-3) as loop, main.eoe.connect(tap) as bridge:
            assert bridge.positions == (1,)
            loop.wait(arm.move_by(0.1))
            loop.run_in_background()
            for number, size in enumerate((0, 56, 1000, 1472)):
                assert pinged("192.168.7.2", number, size) == ping(number, size)[42:]
            digest = hashlib.sha256(PAGE.encode()).hexdigest()
            assert hashlib.sha256(fetched("192.168.7.2")).hexdigest() == digest
            assert main.subs[1].sdo.read(0x1018, 1) == b"YNTC"
            assert not bridge.errors
            assert servo.drive_state() == other.drive_state() == "OPERATION ENABLED"
            assert loop.timing.counters["cycles"] > 100
