"""What tests keep of compilers from run to run is of the same bytes, and no warning is hidden by it."""

import os
import shutil
import time
from pathlib import Path

import pytest

import compiled_once as module
from compiled_once import compiled_once

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
TEXT = "int answer(void) { return 42; }\n"
COMMAND = ("gcc", "-Wall", "-Werror", "-c", "-x", "c")


@pytest.fixture(autouse=True)
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A place of its own, with nothing in it."""
    monkeypatch.setattr(module, "KEPT", tmp_path / "kept")
    return tmp_path / "kept"


def test_the_same_bytes_are_compiled_once(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same text by the same command is taken as it is kept; by another one, or with other headers, it is not."""
    first = compiled_once(TEXT, tmp_path / "first", COMMAND).read_bytes()
    (place,) = kept.iterdir()
    assert place.read_bytes() == first
    place.write_bytes(b"as it was")
    assert compiled_once(TEXT, tmp_path / "again", COMMAND).read_bytes() == b"as it was"
    for text, command in ((TEXT.replace("42", "43"), COMMAND), (TEXT, (*COMMAND, "-O2"))):
        assert compiled_once(text, tmp_path / "other", command).read_bytes() != b"as it was"
    headers = {"more.h": "int more(void);\n"}
    assert compiled_once(TEXT, tmp_path / "other", COMMAND, headers).read_bytes() != b"as it was"
    monkeypatch.setattr(module, "_around", lambda: ("another header",))
    assert compiled_once(TEXT, tmp_path / "other", COMMAND).read_bytes() != b"as it was"
    assert len(list(kept.iterdir())) == 5


@pytest.mark.parametrize("which", ["folder", "file", "link"])
def test_what_others_may_write_is_not_believed(kept: Path, tmp_path: Path, which: str) -> None:
    """Code of a folder or a file that others may have put there, or may change, is not run; it is compiled anew."""
    compiled_once(TEXT, tmp_path / "first", COMMAND)
    (place,) = kept.iterdir()
    place.write_bytes(b"as another wrote it")
    match which:
        case "folder":
            kept.chmod(0o770)
        case "file":
            place.chmod(0o702)
        case "link":
            kept.rename(tmp_path / "elsewhere")
            kept.symlink_to(tmp_path / "elsewhere")
    assert compiled_once(TEXT, tmp_path / "again", COMMAND).read_bytes() != b"as another wrote it"
    if which != "file":
        assert place.read_bytes() == b"as another wrote it", "nothing is put where others may write"


def test_what_fails_is_not_kept(kept: Path, tmp_path: Path) -> None:
    """A warning fails each time, whether something is written or the text is only read."""
    text = "int answer(void) { int unused = 1; return 42; }\n"
    for command in (COMMAND, ("gcc", "-Wall", "-Werror", "-fsyntax-only", "-x", "c")):
        for _ in range(2):
            with pytest.raises(AssertionError, match="unused"):
                compiled_once(text, tmp_path / "made", command)
    assert not kept.exists()


def test_what_was_not_used_for_longest_goes(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """There is room for so many bytes."""
    size = compiled_once(TEXT, tmp_path / "made", COMMAND).stat().st_size
    (first,) = kept.iterdir()
    compiled_once(TEXT.replace("2", "3"), tmp_path / "made", COMMAND)
    (second,) = {*kept.iterdir()} - {first}
    for path, age in ((first, 20.0), (second, 10.0)):  # the clock of files is coarser than this test is quick
        os.utime(path, (time.time() - age,) * 2)
    compiled_once(TEXT, tmp_path / "made", COMMAND)  # the oldest, and now the newest
    monkeypatch.setattr(module, "MOST_BYTES", 2 * size + size // 2)
    compiled_once(TEXT.replace("2", "4"), tmp_path / "made", COMMAND)
    assert len(list(kept.iterdir())) == 2
    assert first.exists()
    assert not second.exists()


def test_headers_of_the_core_and_of_the_program_count() -> None:
    """A change of any of them is seen."""
    texts = module._around()
    for name in ("core/filter.h", "program/json.h"):
        assert (module.SOURCE / name).read_text(encoding="utf-8") in texts
    for name in ("../fuzz/drive.c", "plant_memory.c"):
        assert (module.HERE / name).read_text(encoding="utf-8") in texts
