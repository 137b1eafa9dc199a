from collections.abc import Iterator

import pytest

from catenary.remote import Client, connect
from tests.remote.programs import Running, program


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    with program() as found:
        yield found


@pytest.fixture
def client(running: Running) -> Iterator[Client]:
    with connect(running.name) as found:
        yield found
