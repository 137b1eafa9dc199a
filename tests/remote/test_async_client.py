"""The client for asyncio."""

from __future__ import annotations

import asyncio

import pytest

from catenary.errors import SdoAbort, ShareError
from catenary.remote import connect_async
from tests.remote.programs import Running, program

SERVO = 1


def test_several_requests_wait_at_a_time(running: Running) -> None:
    async def talk() -> None:
        async with await connect_async(running.name) as client:
            hello, devices, value = await asyncio.gather(
                client.call("hello"),
                client.call("devices"),
                client.call("sdo_read", position=SERVO, index=0x1018, subindex=1),
            )
            assert hello.share == running.name
            assert len(devices) == 3
            assert value.value == devices[SERVO].vendor

    asyncio.run(talk())


def test_errors_belong_to_their_request(running: Running) -> None:
    async def talk() -> None:
        async with await connect_async(running.name) as client:
            refused, hello = await asyncio.gather(
                client.call("sdo_read", position=SERVO, index=0x5FFF),
                client.call("hello"),
                return_exceptions=True,
            )
            assert isinstance(refused, SdoAbort)
            assert hello.share == running.name

    asyncio.run(talk())


def test_a_long_result_comes_in_parts(running: Running) -> None:
    async def talk() -> None:
        async with await connect_async(running.name) as client:
            pages = await client.call("objects", position=SERVO, count=500)
            assert len(pages.entries) > 100

    asyncio.run(talk())


def test_requests_fail_when_the_loop_ends() -> None:
    async def talk() -> None:
        with program() as own:
            client = await connect_async(own.name)
            await client.call("hello")
        with pytest.raises(ShareError):
            await client.call("hello")
        await client.close()

    asyncio.run(talk())


def test_a_share_that_does_not_exist() -> None:
    with pytest.raises(ShareError, match="no program serves"):
        asyncio.run(connect_async("does-not-exist"))
