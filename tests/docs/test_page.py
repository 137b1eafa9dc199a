"""The comments and blocks of docs/README.md do what it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.page import run_page

PAGE = """
# A page

<!-- test: main, subs, arm = three_drives(); loop = open_loop(arm) -->

```python
assert len(subs.drives) == 3
for cycle in loop:
    last = cycle.time
```

The loop has no end.

```python
assert last > 1.0
main.close()
```

<!-- no-test: needs a NIC -->
```python
import a_module_that_does_not_exist
```

```python
>>> 1 + 1
2
```

```toml
# machine.toml
format = "catenary-machine-1"
```

<!-- test
from pathlib import Path

assert Path("machine.toml").is_file()
-->

```python
import catenary as cat

with cat.MainDevice("eth0,eth1") as main:
    assert len(main.scan()) == 6
```

<!-- test: eth0, eth1 = ring() -->
```python
with cat.MainDevice("eth0", "eth1") as main:
    assert len(main.scan()) == 6
```
"""


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)

    def run_text(text: str) -> int:
        path = tmp_path / "page.md"
        path.write_text(text)
        return run_page(path, monkeypatch)

    return run_text


def test_a_page_with_everything(run) -> None:
    assert run(PAGE) == 11


def test_a_failure_names_the_line_of_the_page(run) -> None:
    with pytest.raises(ZeroDivisionError) as error:
        run("text\n\n```python\na = 1\n1 / 0\n```\n")
    assert error.traceback[-1].lineno + 1 == 5


def test_a_skip_needs_a_reason(run) -> None:
    with pytest.raises(AssertionError, match="needs a reason"):
        run("<!-- no-test: -->\n```python\n1 / 0\n```\n")
