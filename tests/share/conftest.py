from collections.abc import Iterator

import pytest

from tests.share.names import own_name


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("share") as name:
        yield name
