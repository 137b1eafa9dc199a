from collections.abc import Iterator

import pytest

from tests.dashboard.serving import Page, running_loop, serving
from tests.share.names import own_name


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("page") as name:
        yield name


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    """Server of a loop with two axes."""
    with own_name("module") as name, running_loop(name), serving(name) as page:
        yield page
