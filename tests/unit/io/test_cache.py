"""The cache folder: what is believed, what is not, who may write, and what makes room."""

import errno
import multiprocessing
import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from faultbond.errors import CacheError
from faultbond.io import cache as module
from faultbond.io.cache import Library, cache_folder, loadable, read_kept, write_kept

NAME, CONTENT = "0123.so", bytes(range(256)) * 40

ONE, TWO = Library(name="one.so", content=b"one"), Library(name="two.so", content=b"two")

needs_owners = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs owners of files")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own for each test, with one file in it."""
    found = tmp_path / "deep" / "cache"
    monkeypatch.setenv("FAULTBOND_CACHE", str(found))
    write_kept(NAME, CONTENT)
    return found


def test_what_is_written_is_read(folder: Path) -> None:
    """A file is given back as it was written; there is nothing else, and nothing under another name."""
    assert read_kept(NAME) == CONTENT
    assert read_kept("other.so") is None
    assert [path.name for path in folder.iterdir()] == [NAME]
    write_kept("empty.so", b"")
    assert read_kept("empty.so") == b""


@pytest.mark.parametrize(
    "damage",
    [
        lambda whole: b"",
        lambda whole: whole[:31],
        lambda whole: whole[:32],
        lambda whole: whole[:4096],
        lambda whole: whole[:-1],
        lambda whole: whole + b"\0",
        lambda whole: b"?" + whole[1:],
        lambda whole: whole[:-1] + bytes([whole[-1] ^ 1]),
        lambda whole: bytes(len(whole)),
    ],
)
def test_what_is_damaged_is_as_good_as_not_there(damage: Callable[[bytes], bytes], folder: Path) -> None:
    """A file that was cut short, is empty, longer, or differs in a byte is not believed, and can be written again."""
    path = folder / NAME
    path.write_bytes(damage(path.read_bytes()))
    assert read_kept(NAME) is None
    write_kept(NAME, CONTENT)
    assert read_kept(NAME) == CONTENT


def test_every_single_bit_counts(folder: Path) -> None:
    """No bit of a small file can be turned without notice."""
    write_kept("small.so", b"ab")
    whole = (folder / "small.so").read_bytes()
    for bit in range(8 * len(whole)):
        turned = bytearray(whole)
        turned[bit // 8] ^= 1 << bit % 8
        (folder / "small.so").write_bytes(turned)
        assert read_kept("small.so") is None


def test_a_file_under_another_name_is_not_believed(folder: Path) -> None:
    """A whole file that belongs elsewhere, as of another model, is not believed."""
    os.replace(folder / NAME, folder / "4567.so")
    assert read_kept("4567.so") is None


@needs_owners
@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777, 0o666])
def test_a_file_that_others_may_write_is_not_believed(mode: int, folder: Path) -> None:
    """A file that the group or others may write is not believed."""
    (folder / NAME).chmod(mode)
    assert read_kept(NAME) is None


@needs_owners
def test_what_another_owns_is_not_believed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of another user is not believed, and a folder of another is refused."""
    if os.geteuid() == 0:
        os.chown(folder / NAME, 12345, -1)
    else:
        real = os.fstat

        def of_another(number: int) -> os.stat_result:
            found = list(real(number))
            if not os.path.isdir(f"/proc/self/fd/{number}"):
                found[4] += 1
            return os.stat_result(found)

        monkeypatch.setattr(os, "fstat", of_another)
    assert read_kept(NAME) is None
    if os.geteuid() == 0:
        os.chown(folder, 12345, -1)
    else:
        monkeypatch.undo()
        monkeypatch.setenv("FAULTBOND_CACHE", str(folder))
        owner = folder.stat().st_uid
        monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    with pytest.raises(CacheError, match="others own this folder"):
        read_kept(NAME)


@needs_owners
@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o775, 0o702])
def test_a_folder_that_others_may_write_is_refused(mode: int, folder: Path) -> None:
    """Nothing is read from, written to or loaded by way of a folder that others may write."""
    folder.chmod(mode)
    for use in (lambda: read_kept(NAME), lambda: write_kept(NAME, CONTENT), lambda: loadable([]).__enter__()):
        with pytest.raises(CacheError, match=r"others own this folder or may write it.*`chmod go-w"):
            use()


def test_links_are_not_followed(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A link in place of a file is not believed, and one in place of the folder is refused."""
    (folder / NAME).rename(tmp_path / NAME)
    (folder / NAME).symlink_to(tmp_path / NAME)
    assert read_kept(NAME) is None
    write_kept(NAME, CONTENT)
    assert not (folder / NAME).is_symlink()
    link = tmp_path / "link"
    link.symlink_to(folder)
    monkeypatch.setenv("FAULTBOND_CACHE", str(link))
    with pytest.raises(CacheError, match="this is a link"):
        read_kept(NAME)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_what_is_no_file_is_not_believed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe, a socket or a folder in place of a file is not believed, and nobody waits for it."""
    (folder / NAME).unlink()
    os.mkfifo(folder / NAME, 0o600)
    assert read_kept(NAME) is None
    write_kept(NAME, CONTENT)
    assert read_kept(NAME) == CONTENT
    (folder / "dir.so").mkdir(mode=0o700)
    assert read_kept("dir.so") is None
    with pytest.raises(OSError, match="directory"):
        write_kept("dir.so", CONTENT)
    assert sorted(path.name for path in folder.iterdir()) == [NAME, "dir.so"]
    with socket.socket(socket.AF_UNIX) as plug:
        monkeypatch.chdir(folder)  # a socket's name is short
        plug.bind("plug.so")
    assert read_kept("plug.so") is None


def test_what_was_not_used_for_longest_makes_room(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond so many files the one goes that was not read or written for longest; drafts go when they are old."""
    monkeypatch.setattr(module, "MOST_FILES", 3)
    (folder / "notes").write_text("of somebody else")
    (folder / "closed_forms").mkdir()
    for name in (".draft-old", ".draft-new"):
        (folder / name).mkdir()
        (folder / name / "engine0.so").write_text("")
    (folder / ".draft-file").write_text("")
    for name in (".draft-old", ".draft-file"):
        os.utime(folder / name, (1e9, 1e9))
    for k, name in enumerate((NAME, "b.so", "c.plant")):
        write_kept(name, CONTENT)
        os.utime(folder / name, (1.1e9 + k, 1.1e9 + k))
    assert read_kept(NAME) == CONTENT  # the oldest, and now the newest
    write_kept("d.so", CONTENT)
    others = {".draft-new", "notes", "closed_forms"}
    assert {path.name for path in folder.iterdir()} == {NAME, "c.plant", "d.so"} | others


def test_engines_of_hundreds_of_plants_stay(folder: Path) -> None:
    """Where more are used in turn than there is room for, each pushes out the one that is used next."""
    for k in range(1500):
        (folder / f"{k}.so").write_bytes(b"")
    write_kept("more.so", CONTENT)
    assert len(list(folder.iterdir())) == 1 + 1500 + 1


def test_the_cache_is_bounded_in_bytes(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond so many bytes files go too; the one that was just written stays, however large."""
    monkeypatch.setattr(module, "MOST_BYTES", 3 * len(CONTENT))
    os.utime(folder / NAME, (9e8, 9e8))
    for k in range(5):
        write_kept(f"{k}.so", CONTENT)
        os.utime(folder / f"{k}.so", (1e9 + k, 1e9 + k))
    assert {path.name for path in folder.iterdir()} == {"3.so", "4.so"}  # three would be a checksum too large
    write_kept("large.so", CONTENT * 4)
    assert {path.name for path in folder.iterdir()} == {"large.so"}
    assert read_kept("large.so") == CONTENT * 4


def use_for_a_while(seed: int) -> int:
    """Write and read a few names again and again; count what was read and was neither whole nor absent."""
    module.MOST_FILES = 3  # of this process: files vanish while others read them
    wrong = 0
    for k in range(150):
        name = f"{(seed + k) % 5}.so"
        write_kept(name, name.encode() * 20_000)
        found = read_kept(f"{(3 * seed + k) % 5}.so")
        wrong += found not in (None, f"{(3 * seed + k) % 5}.so".encode() * 20_000)
    return wrong


def test_processes_do_not_disturb_each_other(folder: Path) -> None:
    """Processes that write, read and make room at once read whole files or none, and leave no draft behind."""
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        assert pool.map(use_for_a_while, range(4)) == [0, 0, 0, 0]
    names = {path.name for path in folder.iterdir()}
    assert len(names) <= 4
    assert all(name.endswith(".so") for name in names)


def test_copies_are_private_and_go_again(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is loaded stands where nobody else comes, in the cache or beside other temporary files, and is removed."""
    with loadable([ONE, TWO]) as paths:
        assert [path.read_bytes() for path in paths] == [ONE.content, TWO.content]
        assert paths[0].parent.stat().st_mode & 0o777 == 0o700
        assert paths[0].resolve().parents[1] == folder.resolve()
    assert [path.name for path in folder.iterdir()] == [NAME]
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "none"))
    with loadable([ONE]) as paths:
        assert paths[0].parent.stat().st_mode & 0o777 == 0o700
        assert not (tmp_path / "none").exists()
    assert not paths[0].exists()


def test_where_nothing_can_be_written_the_cache_itself_is_loaded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a full disk what is loaded stands in the cache, where it is that and whole; else there is nothing to load."""

    def full(self: Path, content: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    kept = Library(name=NAME, content=CONTENT)
    with loadable([kept]) as (path,):
        assert path.resolve() == folder.resolve() / NAME
        assert path.read_bytes()[: len(CONTENT)] == CONTENT
    for other in (ONE, Library(name=NAME, content=b"other")):
        with pytest.raises(OSError, match="No space"):
            loadable([kept, other]).__enter__()
    (folder / NAME).chmod(0o777)
    with pytest.raises(OSError, match="No space"):
        loadable([kept]).__enter__()


def test_a_folder_that_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there can be no cache, nothing is found in it, and who writes is told."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "file" / "cache"))
    assert read_kept(NAME) is None
    with pytest.raises(OSError, match="Not a directory"):
        write_kept(NAME, CONTENT)
    with loadable([ONE]) as (path,):
        assert path.read_bytes() == ONE.content


def test_place_of_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The cache is where FAULTBOND_CACHE says, else in the user's cache folder."""
    assert cache_folder() == Path(os.environ["FAULTBOND_CACHE"])
    monkeypatch.delenv("FAULTBOND_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "faultbond"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "faultbond"
