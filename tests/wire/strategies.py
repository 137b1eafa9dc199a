"""Hypothesis strategies for the values of `catenary.wire`."""

from __future__ import annotations

from hypothesis import strategies as st

from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import Frame

u8 = st.integers(0, 0xFF)
u16 = st.integers(0, 0xFFFF)
u32 = st.integers(0, 0xFFFF_FFFF)
u64 = st.integers(0, (1 << 64) - 1)
i32 = st.integers(-(1 << 31), (1 << 31) - 1)
flag = st.booleans()
mac = st.binary(min_size=6, max_size=6)

datagrams = st.builds(
    Datagram,
    command=st.sampled_from(EcatCommand),
    address=u32,
    data=st.binary(max_size=100),
    index=u8,
    working_counter=u16,
    circulating=flag,
    interrupt=u16,
)


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    padding = draw(st.binary(max_size=50))
    return Frame(
        tuple(draw(st.lists(datagrams, min_size=1, max_size=10))),
        draw(mac),
        draw(mac),
        padding,
        draw(st.integers(0, len(padding))),
    )
