import shutil
from pathlib import Path

import pytest

from benchmarks import compiler
from benchmarks.compiler import CompilerError, compile_peer

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc)")


@needs_compiler
@pytest.mark.parametrize("name", ["c", "c-ring"])
def test_the_c_peers_compile_without_a_warning(name: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(compiler, "FLAGS", (*compiler.FLAGS, "-Wall", "-Wextra", "-Werror"))
    assert compile_peer(name, tmp_path).exists()


def test_a_missing_compiler_is_one_clear_line(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(CompilerError) as caught:
        compile_peer("c", tmp_path)
    assert "`cc` was not found" in caught.value.message
    assert "apt install gcc" in caught.value.hint


@needs_compiler
def test_programs_made_elsewhere_do_where_no_compiler_is(tmp_path: Path, monkeypatch) -> None:
    made = compiler.compile_all(tmp_path)
    assert sorted(path.name for path in made) == sorted(compiler.PROGRAMS)
    monkeypatch.setenv("PATH", "")
    assert not compiler.has_programs()
    monkeypatch.setenv(compiler.VARIABLE, str(tmp_path))
    assert compiler.has_programs()
    assert compile_peer("c", tmp_path / "elsewhere") == tmp_path / "c"
