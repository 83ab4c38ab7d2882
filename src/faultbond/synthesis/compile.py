"""Compiling C in process, once per text, compiler and processor; the cache keeps the libraries."""

import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from hashlib import sha256
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

from faultbond.errors import GenerationError
from faultbond.io.cache import LIBRARY, Library, read_kept, write_kept
from faultbond.synthesis.apart import filters_of, shape_of, tables_of

# No sum is contracted, as in no program that is generated, which so gives the same digits: a lane that fits nowhere may
# make much of a last digit. It costs one part in twenty of a bank's time; see docs/decisions/017-core-in-loops.md.
FLAGS = (
    "-march=native",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fPIC",
    "-std=gnu11",
    "-w",
)
# What runs for every lane and sample; what takes longer to compile than it saves.
FAST = ("-O3",)
# Unless asked for this, gcc below -O2 leaves wide registers half in use when it calls `exp` and the like, which then
# take ten times as long.
TIDY = "-fexpensive-optimizations"
QUICK = ("-O1", TIDY)
WARM = ("-O2",)
SHARED = (
    "-std=c99",
    "-fPIC",
    "-fvisibility=hidden",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-w",
)
# All in a third of the time, for what runs for moments: most of the text runs seldom, and is not optimised at all.
HASTY = {WARM: ("-O1",), FAST: ("-O1", TIDY), QUICK: ("-O0",)}
FLEETS = "#define FB_FLEETS\n"
CORE = files("faultbond").joinpath("core")
# Zig would first build a library for what a processor lacks (4 s, 47 MB); one of 64 bits lacks nothing that is used.
# Where nothing is optimised it would watch for what is undefined, which needs a part of that library, and takes long;
# a link that does not say how far it optimises makes that part anew, in half a minute.
ZIG_FLAGS = (*(("-rtlib=none",) if sys.maxsize > 2**32 else ()), "-fno-sanitize=all")
ZIG = (sys.executable, "-m", "ziglang", "cc")
TO_INSTALL = (
    "Install gcc or clang (Debian, Ubuntu: `apt install gcc libc6-dev`), "
    "or `pip install 'faultbond[compiler]'`, which needs no rights"
)
NO_COMPILER = f"There is no C compiler. {TO_INSTALL}."
WASM = (
    "-target",
    "wasm32-wasi-musl",
    "-mexec-model=reactor",
    "-msimd128",
    "-DFB_LANES=2",
    "-std=c99",
    "-fvisibility=hidden",
    "-ffunction-sections",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-w",
)
NO_ZIG = "There is no zig, which compiles for a browser. `pip install ziglang`, or put zig on the PATH."
_ANOTHER = f"{TO_INSTALL}; CC chooses the one to take, as CC='python -m ziglang cc'."
_TIMEOUT = 600.0
_PROCESSOR = ("vendor_id", "cpu family", "model\t", "flags", "Features", "CPU ")  # lines of /proc/cpuinfo that tell it


def find_compiler() -> tuple[str, ...] | None:
    """Give the command of a C compiler: `CC`, there or not, `cc`, `gcc`, `clang`, or ziglang; None if there is none."""
    wanted = os.environ.get("CC", "").strip()
    try:
        chosen = tuple(shlex.split(wanted))  # with options, `gcc -O2`, as a shell reads them
    except ValueError:  # quotation marks stay open
        chosen = (wanted,)
    if chosen:
        return chosen
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return (name,)
    return ZIG if find_spec("ziglang") is not None else None


def required_compiler() -> tuple[str, ...]:
    """Give the command of a C compiler.

    Raises
    ------
    GenerationError
        Where there is none; says what to install.
    """
    compiler = find_compiler()
    if compiler is None:
        raise GenerationError(NO_COMPILER)
    return compiler


def compiler_title(compiler: tuple[str, ...]) -> str:
    """Give a command as users know it."""
    return "zig cc" if compiler == ZIG else " ".join(compiler)


def compiler_version(compiler: tuple[str, ...]) -> str:
    """Give the first line of what a compiler says of itself; nothing where it says nothing."""
    try:
        done = subprocess.run(  # noqa: S603 - the user's compiler
            [*compiler, "--version"], capture_output=True, text=True, timeout=_TIMEOUT, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return next(iter(done.stdout.strip().splitlines()), "") if done.returncode == 0 else ""


def compile_core(model: str, compiler: tuple[str, ...], *, fleets: bool = False, brief: bool = False) -> Library:
    """Give the core of a model, `model.h`, compiling it if the cache does not hold it.

    Parameters
    ----------
    model : the text
    compiler : command of the compiler
    fleets : with what fleets need
    brief : in a third of the time; it gives the same numbers, more slowly

    Raises
    ------
    GenerationError
        Where the compiler fails; carries its first message, and says what to install.
    CacheError
        Where others may write the cache.
    """
    files = tuple(item.read_text(encoding="utf-8") for item in sorted(CORE.iterdir(), key=lambda item: item.name))
    shape, filters = shape_of(model), filters_of(model)
    rest = f'{FLEETS if fleets else ""}#define FB_APART\n#include "core.c"\n'
    fast, quick = _options(FAST, brief=brief), _options(QUICK, brief=brief)
    parts = {  # most of the text, which models share that differ in numbers, more or fewer of them
        "rest": (shape, rest, quick),
        "bank": (filters, '#include "filters.c"\n', fast),
        "lane": (filters, '#include "one.c"\n', fast),
    }
    if fleets:
        parts |= {"assets": (filters, '#include "fleet.c"\n', fast), "parts": ("", '#include "threads.c"\n', quick)}

    def compiled(name: str) -> bytes:
        header, text, options = parts[name]
        build = partial(_compile_text, header, text, options)
        return _kept((name, header, text, *files, *options), compiler, build).content

    others = {name: partial(compiled, name) for name in parts}
    texts = (model, *(text for _, text, _ in parts.values()), *files, *fast)
    return _kept(texts, compiler, partial(_compile, {"tables": (tables_of(model), quick)}, others=others))


def compile_library(source: str, compiler: tuple[str, ...], *, brief: bool = False) -> Library:
    """Give the shared library of a C source, which may include files of the core; see `compile_core`.

    brief: in three quarters of the time; loops over lanes take hardly longer

    Raises
    ------
    GenerationError
        Where the compiler fails; carries its first message, and says what to install.
    CacheError
        Where others may write the cache.
    """
    files = (item.read_text(encoding="utf-8") for item in sorted(CORE.iterdir(), key=lambda item: item.name))
    options = QUICK if brief else _options(WARM)
    return _kept((source, *files, *options), compiler, partial(_compile, {"source": (source, options)}))


def compile_anew(source: str, compiler: tuple[str, ...]) -> Library:
    """Give the shared library of a C source, compiled even where the cache holds it, and not kept.

    Raises
    ------
    GenerationError
        Where the compiler fails; carries its first message, and says what to install.
    """
    with tempfile.TemporaryDirectory() as work:
        built = _compile({"source": (source, _options(QUICK))}, compiler, Path(work))
        return Library(name=f"anew{LIBRARY}", content=built.read_bytes())


def compile_shared(parts: Mapping[str, Mapping[str, str]], compiler: tuple[str, ...]) -> bytes:
    """Give a shared library for any machine of this kind, which shows only what its text exports.

    Parameters
    ----------
    parts : texts that are compiled by the names of their files, each with all that it includes, itself too
    compiler : command of the compiler

    Raises
    ------
    GenerationError
        Where the compiler fails; carries its first message, and says what to install.
    CacheError
        Where others may write the cache.
    """
    objects = {
        name: _kept((name, *SHARED, *texts, *texts.values()), compiler, partial(_compile_object, name, texts)).content
        for name, texts in parts.items()
    }
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        paths = [work / f"{name}.o" for name in objects]
        for path, content in zip(paths, objects.values(), strict=True):
            path.write_bytes(content)
        built = work / "built.so"
        _run(compiler, (*compiler, *_options(WARM), "-shared", "-s", *map(str, paths), "-lm"), built)
        return built.read_bytes()


def compile_wasm(texts: Mapping[str, str], names: Sequence[str]) -> bytes:
    """Give a module of WebAssembly, which shows only what its text exports.

    Parameters
    ----------
    texts : all files by their paths; those in `core` and `program` find each other
    names : those that are compiled

    Raises
    ------
    GenerationError
        Where there is no zig, or it fails.
    CacheError
        Where others may write the cache.
    """
    zig = ("zig", "cc") if shutil.which("zig") else ZIG
    if zig == ZIG and find_spec("ziglang") is None:
        raise GenerationError(NO_ZIG)
    return _kept(("wasm", *WASM, *texts, *texts.values()), zig, partial(_compile_wasm, texts, names)).content


def _compile_wasm(texts: Mapping[str, str], names: Sequence[str], compiler: tuple[str, ...], work: Path) -> Path:
    """Give the path of a module, made in the folder `work`; zig keeps its library of C for the next model."""
    for file, text in texts.items():
        (work / file).parent.mkdir(exist_ok=True)
        (work / file).write_text(text, encoding="utf-8")
    built = work / "page.wasm"
    places = (f"-I{work}", f"-I{work / 'core'}", f"-I{work / 'program'}")
    told = (*compiler, *WASM, *_options(WARM), *places, *(str(work / name) for name in names), "-s")
    _run(compiler, told, built, keeps_library=True)
    return built


def _compile_object(name: str, texts: Mapping[str, str], compiler: tuple[str, ...], work: Path) -> Path:
    """Give the path of a compiled text, made in the folder `work`."""
    for file, text in texts.items():
        (work / file).write_text(text, encoding="utf-8")
    built = work / "built.o"
    _run(compiler, (*compiler, *SHARED, *_options(WARM), "-c", str(work / name)), built)
    return built


def _options(level: tuple[str, ...], *, brief: bool = False) -> tuple[str, ...]:
    """Give how far a text is optimised: less where it runs for moments, and where `FAULTBOND_HASTY` is 1."""
    return HASTY[level] if brief or os.environ.get("FAULTBOND_HASTY") == "1" else level


def _kept(texts: tuple[str, ...], compiler: tuple[str, ...], build: Callable[[tuple[str, ...], Path], Path]) -> Library:
    """Give a library of some texts, built if the cache does not hold it."""
    told = (*texts, *FLAGS, compiler_identity(compiler), processor())
    name = sha256("\0".join(told).encode()).hexdigest()[:32] + LIBRARY
    kept = read_kept(name)
    if kept is not None:
        return Library(name=name, content=kept)
    with tempfile.TemporaryDirectory() as work:
        built = build(compiler, Path(work)).read_bytes()
    with suppress(OSError):  # without a place to keep it, it is compiled again the next time
        write_kept(name, built)
    return Library(name=name, content=built)


def _compile(
    parts: Mapping[str, tuple[str, tuple[str, ...]]],
    compiler: tuple[str, ...],
    work: Path,
    *,
    others: Mapping[str, Callable[[], bytes]] = MappingProxyType({}),
) -> Path:
    """Give the path of the library, compiled in the folder `work` from texts with their options, side by side.

    others : what gives parts that are compiled elsewhere
    """
    _write(work, {f"{name}.c": text for name, (text, _) in parts.items()})
    with ThreadPoolExecutor() as pool:
        given = {name: pool.submit(give) for name, give in others.items()}
        found = [pool.submit(_compile_part, name, options, compiler, work) for name, (_, options) in parts.items()]
        objects = [item.result() for item in found]
        for name, item in given.items():
            objects.append(work / f"{name}.o")
            objects[-1].write_bytes(item.result())
    built = work / "built.so"
    joined = (*compiler, *FLAGS, *_options(FAST), "-shared", *map(str, objects))
    _run(compiler, (*joined, "-lm", "-pthread"), built)
    return built


def _compile_text(header: str, text: str, options: tuple[str, ...], compiler: tuple[str, ...], work: Path) -> Path:
    """Give the path of a compiled text of the core with its `model.h`, made in the folder `work`."""
    _write(work, {"model.h": header, "text.c": text})
    return _compile_part("text", options, compiler, work)


def _compile_part(name: str, options: tuple[str, ...], compiler: tuple[str, ...], work: Path) -> Path:
    """Give the path of one compiled text of the folder `work`."""
    source, built = work / f"{name}.c", work / f"{name}.o"
    place = (f"-I{work}", f"-I{CORE}")
    _run(compiler, (*compiler, *FLAGS, *options, *place, "-c", str(source)), built)
    return built


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def _run(compiler: tuple[str, ...], command: tuple[str, ...], built: Path, *, keeps_library: bool = False) -> None:
    """Let the compiler write a file; for another machine it makes a library of C first, worth keeping."""
    title, flags = compiler_title(compiler), ZIG_FLAGS if "ziglang" in compiler and not keeps_library else ()
    # What zig keeps for another time would be of no use, since a library is compiled once; of `CC`, which may be zig
    # itself, it would ask where the system's library is.
    environment = {name: value for name, value in os.environ.items() if name != "CC"}
    for name in ("ZIG_LOCAL_CACHE_DIR", *(() if keeps_library else ("ZIG_GLOBAL_CACHE_DIR",))):
        environment.setdefault(name, str(built.parent / "zig"))
    try:
        done = subprocess.run(  # noqa: S603 - our own text, no shell
            [*command, *flags, "-o", str(built)],
            capture_output=True,
            text=True,
            timeout=_TIMEOUT,
            check=False,
            env=environment,
        )
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise GenerationError(f"The C compiler {title} did not finish: {problem}. {_ANOTHER}") from problem
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["no message"]
        first = next((line for line in lines if "error" in line), lines[0])
        raise GenerationError(f"The C compiler {title} failed: {first.rstrip('.')}. {_ANOTHER}")
    if not built.is_file():
        raise GenerationError(f"The C compiler {title} failed: it wrote nothing. {_ANOTHER}")


def compiler_identity(compiler: tuple[str, ...]) -> str:
    """Give what changes with the compiler: its command, which file that is, which need not be there, and its haste."""
    files = [shutil.which(compiler[0])]
    if compiler[1:2] == ("-m",):  # a package of Python
        package = find_spec(compiler[2])
        files.append(package.origin if package is not None else None)
    found = [*compiler, *_options(FAST), *_options(QUICK)]
    for file in files:
        with suppress(OSError):
            real = Path(file or "").resolve()
            about = real.stat()
            found += [str(real), str(about.st_size), str(about.st_mtime_ns)]
    return "\0".join(found)


def processor() -> str:
    """Name the machine's processor and instruction set, so that a cache on a shared disk serves only like ones."""
    told = [platform.machine()]
    try:
        with Path("/proc/cpuinfo").open() as lines:
            for line in lines:
                if not line.strip():  # the first processor; there may be hundreds
                    break
                if line.startswith(_PROCESSOR):
                    told.append(line)
    except OSError:
        told.append(platform.processor())
    return "".join(told)
