"""Compiling once, several processes at a time, and doing without a compiler."""

import ctypes
import multiprocessing
import os
from pathlib import Path

import numpy as np
import pytest

from faultbond.app.engine_choice import engine_title
from faultbond.arrays import FloatArray
from faultbond.cli import main
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.errors import CacheError, GenerationError
from faultbond.model.text import load_model
from faultbond.runtime.library import CompiledEngine, load_engine
from faultbond.runtime.start import healthy_lane
from faultbond.synthesis.compile import cache_folder, compile_library, find_compiler
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.machine import VirtualMachine
from faultbond.types import EngineChoice

RC = Path(__file__).parents[3] / "examples" / "rc" / "model.yaml"
SOURCE = "int answer(void) { return 42; }\n"

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of its own for each test."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("FAULTBOND_CACHE", str(folder))
    return folder


def counting_compiler(folder: Path) -> tuple[Path, Path]:
    """A compiler that notes each of its calls in a file; gives both."""
    real = find_compiler()
    assert real is not None
    log, script = folder / "calls", folder / "counting-cc"
    script.write_text(f'#!/bin/sh\necho called >> "{log}"\nexec {" ".join(real)} "$@"\n')
    script.chmod(0o755)
    return script, log


def some_steps(spec: EngineSpec, engine: Engine) -> FloatArray:
    """Numbers of a lane after 50 made-up samples."""
    lane = healthy_lane(spec, np.array([1.0]), np.array([[0.5]]))
    samples, place = np.zeros((50, spec.n_sample)), spec.sample_fields
    samples[:, place["dt"]], samples[:, place["scale"]], samples[:, place["use"]] = 0.02, 1.0, 1.0
    samples[:, place["u"]] = samples[:, place["u_before"]] = 5.0
    samples[:, place["y"]] = np.linspace(1.0, 1.5, 50)[:, None]
    return engine.advance(lane, samples)[0][:, 0]


@needs_compiler
def test_second_build_uses_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    """A model is compiled once for each sort of lane; the second engine comes from the cache, with the same numbers."""
    script, log = counting_compiler(tmp_path)
    monkeypatch.setenv("CC", str(script))
    first, second = (some_steps(*build_engine(load_model(RC))) for _ in range(2))
    assert log.read_text().count("called") == 2
    assert [item.suffix for item in cache.iterdir()] == [".so", ".so"]
    assert np.array_equal(first, second)


@needs_compiler
def test_other_source_is_compiled_anew(cache: Path) -> None:
    """Another source, or another compiler, has a library of its own."""
    compiler = find_compiler()
    assert compiler is not None
    first = compile_library(SOURCE, compiler)
    assert compile_library(SOURCE, compiler) == first
    assert compile_library(SOURCE.replace("42", "43"), compiler) != first
    assert compile_library(SOURCE, (*compiler, "-DOTHER")) != first
    assert len(list(cache.iterdir())) == 3


def run_in_process(number: int) -> tuple[str, list[float]]:
    """Build an engine and run it; what a worker process does."""
    spec, engine = build_engine(load_model(RC))
    del number
    return type(engine).__name__, some_steps(spec, engine).tolist()


@needs_compiler
def test_several_processes_at_once(cache: Path) -> None:
    """Four processes that find an empty cache all get a working engine, and one library a sort of lane remains."""
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        found = pool.map(run_in_process, range(4), chunksize=1)
    assert {name for name, _ in found} == {CompiledEngine.__name__}
    assert all(numbers == found[0][1] for _, numbers in found)
    assert np.all(np.isfinite(found[0][1]))
    assert [item.suffix for item in cache.iterdir()] == [".so", ".so"]


def test_broken_compiler_is_as_good_as_none(monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    """With a compiler that fails, the interpreter runs the model, and nothing is left in the cache."""
    monkeypatch.setenv("CC", "/bin/false")
    spec, engine = build_engine(load_model(RC))
    assert isinstance(engine, VirtualMachine)
    assert np.all(np.isfinite(some_steps(spec, engine)))
    assert not list(cache.iterdir())


def test_no_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Without any compiler the interpreter runs the model."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("faultbond.synthesis.compile.find_spec", lambda _name: None)
    assert find_compiler() is None
    spec, engine = build_engine(load_model(RC))
    assert isinstance(engine, VirtualMachine)
    assert np.all(np.isfinite(some_steps(spec, engine)))


def test_compiler_can_be_left_out(cache: Path) -> None:
    """Asked to do without a compiler, the builder compiles nothing."""
    _, engine = build_engine(load_model(RC), compiled=False)
    assert isinstance(engine, VirtualMachine)
    assert not cache.exists()


def test_failure_is_reported_with_the_first_message(tmp_path: Path) -> None:
    """A compiler that fails, or does not exist, gives an error with its name and what it said first."""
    script = tmp_path / "grumbling-cc"
    script.write_text("#!/bin/sh\necho 'no such target' >&2\necho more >&2\nexit 1\n")
    script.chmod(0o755)
    with pytest.raises(GenerationError, match=r"the C compiler .*grumbling-cc failed: no such target$"):
        compile_library(SOURCE, (str(script),))
    with pytest.raises(GenerationError, match=r"the C compiler .*missing-cc did not finish"):
        compile_library(SOURCE, (str(tmp_path / "missing-cc"),))


def test_library_that_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    """A file that is no library is refused with its path and what to do."""
    path = tmp_path / "engine.so"
    path.write_text("nonsense")
    with pytest.raises(GenerationError, match=r"engine\.so: the compiled engine cannot be loaded .*; remove it"):
        load_engine(path, 2, "cc")


@needs_compiler
def test_cache_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the cache folder cannot be made, the interpreter runs the model."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "file" / "cache"))
    _, engine = build_engine(load_model(RC))
    assert isinstance(engine, VirtualMachine)


@needs_compiler
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a folder in which nobody can make a file")
def test_cache_in_which_nothing_can_be_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is a cache folder but no file can be made in it, the interpreter runs the model too."""
    monkeypatch.setenv("FAULTBOND_CACHE", "/proc")
    _, engine = build_engine(load_model(RC))
    assert isinstance(engine, VirtualMachine)


def damaged(path: Path, change: str) -> None:
    """Damage a library as a full disk, a copy gone wrong or another user may; one that runs keeps what it had."""
    content = path.read_bytes()
    path.unlink()
    path.write_bytes({"cut": content[:4096], "empty": b"", "byte": content[:600] + b"?" + content[601:]}[change])


@needs_compiler
@pytest.mark.parametrize("change", ["cut", "empty", "byte"])
def test_a_damaged_library_is_built_anew(change: str, cache: Path) -> None:
    """A library that was cut short, is empty or changed in one byte is not loaded, but made again."""
    expected = some_steps(*build_engine(load_model(RC)))
    whole = {path: path.read_bytes() for path in cache.iterdir()}
    for path in whole:
        damaged(path, change)
    assert np.array_equal(some_steps(*build_engine(load_model(RC))), expected)
    assert all(len(path.read_bytes()) == len(content) for path, content in whole.items())


@needs_compiler
def test_libraries_of_other_names_are_built_anew(cache: Path) -> None:
    """Two libraries that were swapped, or one that is another model's, are each made again."""
    compiler = find_compiler()
    assert compiler is not None
    answers = (SOURCE, SOURCE.replace("42", "43"))
    first, second = (compile_library(source, compiler) for source in answers)
    contents = first.read_bytes(), second.read_bytes()
    for path, content in ((first, contents[1]), (second, contents[0])):
        path.unlink()
        path.write_bytes(content)
    assert [ctypes.CDLL(str(compile_library(source, compiler))).answer() for source in answers] == [42, 43]


@needs_compiler
@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs owners of files")
def test_a_cache_that_others_may_write_is_refused(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A folder that is another's, or that others may write, is refused in one line that says what to do."""
    cache.mkdir()
    (tmp_path / "r.csv").write_text("time,V,V_C\n0,1,1\n")
    for mode in (0o777, 0o1777, 0o775):
        cache.chmod(mode)
        assert main(["run", str(RC), str(tmp_path / "r.csv")]) == 2
        shown = capsys.readouterr().err
        assert f"{cache}: others own this folder or may write it" in shown
        assert f"`chmod go-w {cache}`" in shown
        assert shown.count("\n") == 1
    cache.chmod(0o755)
    if os.geteuid() == 0:
        os.chown(cache, 12345, -1)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: cache.stat().st_uid + 1)
    with pytest.raises(CacheError, match="others own this folder"):
        build_engine(load_model(RC))


@needs_compiler
@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs owners of files")
def test_a_library_that_others_may_write_is_built_anew(cache: Path) -> None:
    """What is made is the user's alone, and a library that is not so any more, or is a link, is made again."""
    compiler = find_compiler()
    assert compiler is not None
    library = compile_library(SOURCE, compiler)
    assert (cache.stat().st_mode & 0o777, library.stat().st_mode & 0o777) == (0o700, 0o700)
    library.chmod(0o722)
    before = library.stat().st_ino
    assert compile_library(SOURCE, compiler).stat().st_ino != before
    assert library.stat().st_mode & 0o777 == 0o700
    library.rename(cache / "elsewhere")
    library.symlink_to(cache / "elsewhere")
    assert not compile_library(SOURCE, compiler).is_symlink()


@needs_compiler
def test_a_compiler_with_options(monkeypatch: pytest.MonkeyPatch) -> None:
    """`CC` may have options, as make and shells take it; what cannot be read is passed over."""
    monkeypatch.setenv("CC", "cc -O1 '-DNAME=a b'")
    compiler = find_compiler()
    assert compiler == ("cc", "-O1", "-DNAME=a b")
    assert compile_library(SOURCE, compiler).exists()
    assert engine_title(EngineChoice.AUTO).startswith("compiled C (cc -O1 -DNAME=a b), built")
    _, engine = build_engine(load_model(RC))
    assert isinstance(engine, CompiledEngine)
    assert engine.title.endswith("(cc -O1 -DNAME=a b)")
    monkeypatch.setenv("CC", "cc 'open")
    assert find_compiler() == ("cc",)


def test_place_of_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The cache is where FAULTBOND_CACHE says, else in the user's cache folder."""
    assert cache_folder() == Path(os.environ["FAULTBOND_CACHE"])
    monkeypatch.delenv("FAULTBOND_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "faultbond"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "faultbond"
