from collections.abc import Iterator

import pytest

from tests.attack import users


@pytest.fixture
def machine() -> Iterator[users.Machine]:
    """Mounts of their own for programs of other users."""
    if reason := users.refusal():
        pytest.skip(f"no other users: {reason}")
    with users.machine() as machine:
        yield machine
