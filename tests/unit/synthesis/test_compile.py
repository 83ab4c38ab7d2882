"""Compiling once, several processes at a time, and what is said where that fails."""

import ctypes
import multiprocessing
import os
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from faultbond.app.engine import engine_title
from faultbond.arrays import FloatArray
from faultbond.cli import main
from faultbond.contract.spec import EngineSpec
from faultbond.errors import CacheError, GenerationError
from faultbond.io.cache import loadable
from faultbond.model.text import load_model, parse_model
from faultbond.runtime.core import Core, load_core
from faultbond.simulate import Fault
from faultbond.synthesis.compile import compile_library, find_compiler, required_compiler
from faultbond.synthesis.engine import build, build_engine, build_model
from faultbond.synthesis.specify import build_spec
from made import differing, recorded, run

RC = Path(__file__).parents[3] / "examples" / "rc" / "model.yaml"
FAULT = Fault(parameter="C", factor=1.6, start=4.0)
SOURCE = "int answer(void) { return 42; }\n"

# Calls of a compiler for a library, for a core, its texts and what joins them, and for tables alone; and what stays:
# the core, and what of it other models take, of its shape the most, of its laws two texts of filters.
PIECES, PARTS, TABLES = 2, 5, 2
KEPT = [".so"] * 4

needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of its own for each test."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("FAULTBOND_CACHE", str(folder))
    return folder


def counting_compiler(folder: Path) -> tuple[Path, Path]:
    """A compiler that notes each of its calls in a file; gives both."""
    real = required_compiler()
    log, script = folder / "calls", folder / "counting-cc"
    script.write_text(f'#!/bin/sh\necho called >> "{log}"\nexec {" ".join(real)} "$@"\n')
    script.chmod(0o755)
    return script, log


def some_steps(spec: EngineSpec, engine: Core) -> FloatArray:
    """Numbers of a lane after 50 made-up samples."""
    lane = engine.healthy_lane(np.array([1.0]), np.array([[0.5]]))
    samples, place = np.zeros((50, spec.n_sample)), spec.sample_fields
    samples[:, place["dt"]], samples[:, place["scale"]], samples[:, place["use"]] = 0.02, 1.0, 1.0
    samples[:, place["fresh"]] = spec.input_variance
    samples[:, place["u"]] = samples[:, place["u_before"]] = 5.0
    samples[:, place["y"]] = np.linspace(1.0, 1.5, 50)[:, None]
    return engine.advance(lane, samples)[0][:, 0]


def test_second_build_uses_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    """A model is compiled once; the second core comes from the cache, with the same numbers."""
    script, log = counting_compiler(tmp_path)
    monkeypatch.setenv("CC", str(script))
    first, second = (some_steps(*build_engine(load_model(RC))) for _ in range(2))
    assert log.read_text().count("called") == PARTS
    assert [item.suffix for item in cache.iterdir()] == KEPT
    assert np.array_equal(first, second)


def test_other_numbers_take_what_is_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a model with other nominal values only filters and tables are compiled, with other accuracies and noise these.

    A whole run is that of a core made for it. One with another sensor is of another shape, and compiled as a whole.
    """
    script, log = counting_compiler(tmp_path)
    monkeypatch.setenv("CC", str(script))
    text = RC.read_text(encoding="utf-8")
    wider = text.replace("noise: 0.1 V", "noise: 0.2 V").replace("3 %", "4 %")
    other = wider.replace("10 kohm", "11 kohm")
    sensors = text.replace("sensors: {", "sensors: {i: {reads: R.f, unit: A, noise: 1 mA}, ")
    calls, cores = [0], []
    for model in (text, wider, other, sensors):
        cores.append(build_engine(parse_model(model))[1])
        calls.append(log.read_text().count("called"))
    assert np.diff(calls).tolist() == [PARTS, TABLES, PARTS - 1, PARTS]
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "empty"))
    for model in (wider, other):
        cores.append(build_engine(parse_model(model))[1])
        monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "empty, too"))
    assert log.read_text().count("called") == calls[-1] + 2 * PARTS
    nominal, *found = (run(cores[k], recorded("rc", 400, FAULT))[0] for k in (0, 1, 2, 4, 5))
    for shared, whole in zip(found[:2], found[2:], strict=True):
        assert differing(shared, whole) == []
        assert differing(shared, nominal)


def test_in_haste_it_finds_the_same(monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    """With haste and without there are libraries of their own, of one verdict, whose numbers differ by rounding.

    A core that is built for a trial is built in haste.
    """
    found, graph = [], load_model(RC)
    for hasty in ("0", "1"):
        monkeypatch.setenv("FAULTBOND_HASTY", hasty)
        monitor, reports = run(build_engine(graph)[1], recorded("rc", 400, FAULT))
        assert any(report.detection for report in reports)
        found.append(monitor)
    one, two = (item.conclude().candidates for item in found)
    assert [item.hypothesis for item in one] == [item.hypothesis for item in two]
    assert [item.probability for item in one] == pytest.approx([item.probability for item in two], rel=1e-6, abs=1e-9)
    assert found[0].numbers("healthy.lane") == pytest.approx(found[1].numbers("healthy.lane"), rel=1e-9, abs=1e-12)
    assert len(list(cache.glob("*.so"))) == 2 * len(KEPT)
    monkeypatch.setenv("FAULTBOND_HASTY", "0")
    brief, usual = build(graph, brief=True).library, build(graph).library
    assert brief.content != usual.content
    assert len(list(cache.glob("*.so"))) == 3 * len(KEPT)


def test_other_source_is_compiled_anew(cache: Path) -> None:
    """Another source, or another compiler, has a library of its own."""
    compiler = required_compiler()
    first = compile_library(SOURCE, compiler)
    assert compile_library(SOURCE, compiler) == first
    assert len(list(cache.iterdir())) == 1
    assert compile_library(SOURCE.replace("42", "43"), compiler) != first
    assert len(list(cache.iterdir())) == 2
    compile_library(SOURCE, (*compiler, "-DOTHER"))
    assert len(list(cache.iterdir())) == 3


def test_another_compiler_of_the_same_name_compiles_anew(tmp_path: Path, cache: Path) -> None:
    """Where the file behind the command changes, as when a compiler is updated, its libraries are made again."""
    script, log = counting_compiler(tmp_path)
    for _ in range(2):
        compile_library(SOURCE, (str(script),))
    assert log.read_text().count("called") == PIECES
    script.write_text(script.read_text() + "# a later one\n")
    compile_library(SOURCE, (str(script),))
    assert log.read_text().count("called") == 2 * PIECES
    assert len(list(cache.iterdir())) == 2


def run_in_process(number: int) -> tuple[str, list[float]]:
    """Build an engine and run it; what a worker process does."""
    spec, engine = build_engine(load_model(RC))
    del number
    return type(engine).__name__, some_steps(spec, engine).tolist()


def test_several_processes_at_once(cache: Path) -> None:
    """Two processes that find an empty cache both get a working engine, and what one alone leaves remains."""
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.map(run_in_process, range(2), chunksize=1)
    assert {name for name, _ in found} == {Core.__name__}
    assert all(numbers == found[0][1] for _, numbers in found)
    assert np.all(np.isfinite(found[0][1]))
    assert [item.suffix for item in cache.iterdir()] == KEPT


@pytest.mark.parametrize(
    ("compiler", "told"),
    [
        ("/bin/false", "failed: no message"),
        ("/bin/true", "failed: it wrote nothing"),
        ("missing-cc -O2", "did not finish: [Errno 2] No such file or directory: 'missing-cc'"),
        ("cc 'open", 'did not finish: [Errno 2] No such file or directory: "cc \'open"'),
    ],
)
def test_a_compiler_that_fails(
    compiler: str, told: str, monkeypatch: pytest.MonkeyPatch, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With a compiler that fails, or is not there, one line says so and what to install, and nothing is kept."""
    monkeypatch.setenv("CC", compiler)
    assert main(["run", str(RC), str(RC.with_name("healthy.csv"))]) == 2
    shown = capsys.readouterr().err
    assert shown.startswith(f"The C compiler {compiler} {told}. Install gcc or clang")
    assert "`pip install 'faultbond[compiler]'`" in shown
    assert "CC chooses the one to take" in shown
    assert shown.count("\n") == 1
    assert not cache.exists()


def test_no_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, cache: Path) -> None:
    """Without any compiler nothing is built, and the message says what to install."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("faultbond.synthesis.compile.find_spec", lambda _name: None)
    assert find_compiler() is None
    assert engine_title().startswith("none. There is no C compiler. Install")
    with pytest.raises(GenerationError, match=r"There is no C compiler\. Install gcc or clang .* 'faultbond\[compiler"):
        build_engine(load_model(RC))
    assert not cache.exists()


def test_the_wheel_of_zig_is_the_last_resort(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where no compiler is on the path, that of the package `ziglang` is taken, and titled shortly."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("faultbond.synthesis.compile.find_spec", lambda name: name if name == "ziglang" else None)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_compiler() == (sys.executable, "-m", "ziglang", "cc")
    assert engine_title().startswith("compiled C (zig cc), built")
    (tmp_path / "cc").write_text("#!/bin/sh\n")
    (tmp_path / "cc").chmod(0o755)
    assert find_compiler() == ("cc",)


def test_zig_keeps_nothing_and_builds_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: Path
) -> None:
    """Zig has a folder of its own for a while, and is told to build no library of its own."""
    log, home = tmp_path / "calls", tmp_path / "home"
    (tmp_path / "ziglang.py").write_text(
        "import os, pathlib, sys\n"
        f"log = open({str(log)!r}, 'a')\n"
        "folders = os.environ['ZIG_GLOBAL_CACHE_DIR'], os.environ['ZIG_LOCAL_CACHE_DIR']\n"
        "pathlib.Path(folders[0]).mkdir(exist_ok=True)\n"
        "print(*folders, *sys.argv[1:], file=log)\n"
        "pathlib.Path(sys.argv[sys.argv.index('-o') + 1]).write_bytes(b'library')\n"
    )
    for name in ("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("HOME", str(home))
    compile_library(SOURCE, (sys.executable, "-m", "ziglang", "cc"))
    for line in log.read_text().splitlines():
        first, second, *arguments = line.split()
        assert first == second
        assert not Path(first).exists()
        assert ("-rtlib=none" in arguments) is (sys.maxsize > 2**32)
        assert [item for item in arguments if item.startswith("-O")]
    assert [item.suffix for item in cache.iterdir()] == [".so"]
    assert not home.exists()


@needs_zig
def test_zig_and_the_compiler_of_the_system_agree(monkeypatch: pytest.MonkeyPatch, cache: Path, tmp_path: Path) -> None:
    """An engine that zig compiled has the numbers of any other to 1e-9, and leaves libraries only.

    On the way zig builds nothing of its own, which for one that watches for what is undefined takes half a minute.
    """
    expected = some_steps(*build_engine(load_model(RC)))
    before, kept = set(cache.iterdir()), tmp_path / "zig"
    for name in ("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"):
        monkeypatch.setenv(name, str(kept))
    monkeypatch.setenv("CC", f"{sys.executable} -m ziglang cc")
    spec, engine = build_engine(load_model(RC))
    assert engine.title.endswith("(zig cc)")
    assert some_steps(spec, engine) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert {item.suffix for item in set(cache.iterdir()) - before} <= {".so"}
    assert kept.is_dir()
    assert not list(kept.rglob("*.a"))


def test_failure_is_reported_with_the_first_message(tmp_path: Path) -> None:
    """A compiler that fails, or does not exist, gives an error with its name and its first error, or what it said."""
    script = tmp_path / "grumbling-cc"
    for said, told in (("no such target; more", "no such target"), ("note; x.c: error: no", "x.c: error: no")):
        lines = "\n".join(f"echo '{line.strip()}' >&2" for line in said.split(";"))
        script.write_text(f"#!/bin/sh\n{lines}\nexit 1\n")
        script.chmod(0o755)
        with pytest.raises(GenerationError, match=rf"The C compiler .*grumbling-cc failed: {told}\. Install "):
            compile_library(SOURCE, (str(script),))
    with pytest.raises(GenerationError, match=r"The C compiler .*missing-cc did not finish: .*\. Install "):
        compile_library(SOURCE, (str(tmp_path / "missing-cc"),))


def test_library_that_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    """A file that is no library is refused with its path and what to do."""
    path = tmp_path / "engine.so"
    path.write_text("nonsense")
    with pytest.raises(GenerationError, match=r"engine\.so: the compiled core cannot be loaded .*; remove it"):
        load_core(path, build_spec(build_model(load_model(RC))), "cc")


def test_cache_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the cache folder cannot be made, the model is compiled for this once."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "file" / "cache"))
    spec, engine = build_engine(load_model(RC))
    assert isinstance(engine, Core)
    assert np.all(np.isfinite(some_steps(spec, engine)))


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a folder in which nobody can make a file")
def test_cache_in_which_nothing_can_be_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is a cache folder but no file can be made in it, the model is compiled for this once, too."""
    monkeypatch.setenv("FAULTBOND_CACHE", "/proc")
    with loadable([compile_library(SOURCE, required_compiler())]) as (path,):
        assert ctypes.CDLL(str(path)).answer() == 42


def damaged(path: Path, change: str) -> None:
    """Damage a library as a full disk, a copy gone wrong or another user may; one that runs keeps what it had."""
    content = path.read_bytes()
    path.unlink()
    path.write_bytes({"cut": content[:4096], "empty": b"", "byte": content[:600] + b"?" + content[601:]}[change])


def test_a_damaged_library_is_built_anew(cache: Path) -> None:
    """A library that was cut short, is empty or changed in one byte is not loaded, but made again."""
    expected = some_steps(*build_engine(load_model(RC)))
    sizes = {path: path.stat().st_size for path in cache.iterdir()}
    for path in sizes:
        damaged(path, "cut")
    assert np.array_equal(some_steps(*build_engine(load_model(RC))), expected)
    assert {path: path.stat().st_size for path in cache.iterdir()} == sizes
    small = compile_library(SOURCE, required_compiler())
    (path,) = set(cache.iterdir()) - {*sizes}
    for change in ("cut", "empty", "byte"):
        damaged(path, change)
        assert compile_library(SOURCE, required_compiler()) == small


def test_libraries_of_other_names_are_built_anew(cache: Path) -> None:
    """Two libraries that were swapped, or one that is another model's, are each made again."""
    compiler = required_compiler()
    answers = (SOURCE, SOURCE.replace("42", "43"))
    for source in answers:
        compile_library(source, compiler)
    one, other = cache.iterdir()
    contents = one.read_bytes(), other.read_bytes()
    for path, content in ((one, contents[1]), (other, contents[0])):
        path.unlink()
        path.write_bytes(content)
    with loadable([compile_library(source, compiler) for source in answers]) as copies:
        assert [ctypes.CDLL(str(copy)).answer() for copy in copies] == [42, 43]


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


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs owners of files")
def test_a_library_that_others_may_write_is_built_anew(cache: Path, tmp_path: Path) -> None:
    """What is made is the user's alone, and a library that is not so any more, or is a link, is made again."""
    script, log = counting_compiler(tmp_path)
    compiler = (str(script),)
    whole = compile_library(SOURCE, compiler)
    (library,) = cache.iterdir()
    assert (cache.stat().st_mode & 0o777, library.stat().st_mode & 0o777) == (0o700, 0o700)
    for k, mode in enumerate((0o722, 0o702, 0o720, 0o777), start=2):
        library.chmod(mode)
        assert compile_library(SOURCE, compiler) == whole
        assert log.read_text().count("called") == PIECES * k
        assert library.stat().st_mode & 0o777 == 0o700
    library.rename(tmp_path / "elsewhere")
    library.symlink_to(tmp_path / "elsewhere")
    assert compile_library(SOURCE, compiler) == whole
    assert log.read_text().count("called") == 6 * PIECES
    assert not library.is_symlink()


@pytest.mark.skipif(shutil.which("cc") is None, reason="no cc")
def test_a_compiler_with_options(monkeypatch: pytest.MonkeyPatch) -> None:
    """`CC` may have options, as make and shells take it."""
    monkeypatch.setenv("CC", "cc -O1 '-DNAME=a b'")
    compiler = find_compiler()
    assert compiler == ("cc", "-O1", "-DNAME=a b")
    assert compile_library(SOURCE, compiler)
    assert engine_title().startswith("compiled C (cc -O1 -DNAME=a b), built")
    _, engine = build_engine(load_model(RC))
    assert isinstance(engine, Core)
    assert engine.title.endswith("(cc -O1 -DNAME=a b)")
