"""`doctor`: what this installation has, whether it works, and what to do where it does not."""

import platform
import re
import sys
from collections.abc import Iterator
from ctypes import CDLL
from dataclasses import asdict, dataclass
from enum import Enum
from importlib import import_module
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from time import perf_counter

from faultbond.errors import CacheError, GenerationError
from faultbond.io.cache import MOST_BYTES, CacheUse, cache_use, loadable
from faultbond.io.out import Out
from faultbond.synthesis.compile import (
    TO_INSTALL,
    compile_anew,
    compiler_title,
    compiler_version,
    find_compiler,
)

PACKAGE = "faultbond"
MODULES = {
    "pyyaml": "yaml",
    "protobuf": "google.protobuf",
}  # of packages that are imported by another name than they are installed by
GIVES = {  # what each extra is for
    "compiler": "a C compiler for machines that have none",
    "parquet": "recordings as Parquet",
    "plot": "figures of results, `result.plot()`",
    "serve": "the page of `faultbond serve`",
    "mqtt": "its sources and sinks `mqtt://` and `mqtts://`",
    "opcua": "its source and sink `opc.tcp://`",
    "postgres": "its store in a PostgreSQL server",
}
PROBE, ANSWER = "int answer(void) { return 42; }\n", 42
READING, WATCHING, KEEPING = "reading models", "watching plants", "starting at once"
_REQUIREMENT = re.compile(r"([\w.-]+)\s*(?:\[[^\]]*\])?\s*([^;]*)(?:;.*extra\s*==\s*[\"']([\w-]+)[\"'])?")


class State(Enum):
    """How something stands."""

    OK = "ok"
    ABSENT = "absent"  # and not needed
    LESS = "less"  # works, and not as well as it could
    FAILS = "fails"


@dataclass(frozen=True, slots=True, kw_only=True)
class Examined:
    """What was found of one thing.

    group : what kind of thing: `compiler`, `cache`, `library`, `extra`, or `ability`
    advice : what to do about it, empty where nothing
    """

    group: str
    name: str
    state: State
    told: str
    advice: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """What is needed of another package. extra: the extra that needs it; empty where all need it."""

    package: str
    least: str
    extra: str


def doctor(*, out: Out) -> bool:
    """Tell what there is and what works; give whether all verbs do."""
    title = f"{PACKAGE} {version(PACKAGE)}, {platform.python_implementation()} {platform.python_version()}"
    title += f" on {platform.system()} {platform.machine()}"
    out.say(f"{title}\n")
    found = []
    for finding in _findings():  # one by one, since some take a moment
        found.append(finding)
        out.say(_line(finding))
    if out.text is not None:
        out.text.flush()
    abilities = _abilities(found)
    out.say()
    for finding in abilities:
        out.say(_line(finding))
    works = all(item.state is not State.FAILS for item in abilities)
    compiler = find_compiler()
    out.record(
        {
            "record": "doctor",
            "version": version(PACKAGE),
            "python": platform.python_version(),
            "platform": f"{platform.system()} {platform.machine()}",
            "compiler": None if compiler is None else compiler_title(compiler),
            "cache": str(cache_use().folder),
            "works": works,
            "checks": [asdict(item) | {"state": item.state.value} for item in (*found, *abilities)],
        }
    )
    return works


def _line(finding: Examined) -> str:
    told = f"{finding.told}. {finding.advice}" if finding.advice else finding.told
    return f"{finding.state.value:<8}{finding.name:<18}{told}"


def _findings() -> Iterator[Examined]:
    """Look at one thing after another."""
    yield _python()
    yield from _compiler()
    yield _cache(cache_use())
    needed = requirements()
    for item in needed:
        if not item.extra:
            yield _library(item)
    for extra in sorted({item.extra for item in needed if item.extra}):
        yield _extra(extra, [item for item in needed if item.extra == extra])


def _python() -> Examined:
    least = (metadata(PACKAGE)["Requires-Python"] or "").removeprefix(">=")
    new_enough = sys.version_info >= _numbers(least)
    return Examined(
        group="library",
        name="Python",
        state=State.OK if new_enough else State.FAILS,
        told=f"{platform.python_version()}, {sys.executable}",
        advice="" if new_enough else f"Python {least} or newer is needed.",
    )


def _compiler() -> Iterator[Examined]:
    """Look for a C compiler, and let it compile something."""
    compiler = find_compiler()
    if compiler is None:
        yield Examined(
            group="compiler", name="C compiler", state=State.FAILS, told="there is none", advice=f"{TO_INSTALL}."
        )
        return
    says = compiler_version(compiler)
    told = f"{compiler_title(compiler)}: {says}" if says else compiler_title(compiler)
    yield Examined(group="compiler", name="C compiler", state=State.OK, told=told)
    yield _compiled(compiler)


def _compiled(compiler: tuple[str, ...]) -> Examined:
    """Compile a tiny library, load and call it."""
    state, told = State.FAILS, "the library that was compiled gives another answer than it should"
    begin = perf_counter()
    try:
        with loadable([compile_anew(PROBE, compiler)]) as (path,):
            if CDLL(str(path)).answer() == ANSWER:
                state, told = State.OK, f"a tiny library was compiled and called in {perf_counter() - begin:.2f} s"
    except CacheError:
        told = "a tiny library was compiled, and not loaded, since the cache is refused"
    except GenerationError as problem:
        told = str(problem).rstrip(".")
    except OSError as problem:
        told = f"a tiny library was compiled, and cannot be loaded: {problem}"
    return Examined(group="compiler", name="compiling", state=state, told=told)


def _cache(use: CacheUse) -> Examined:
    """Tell of the folder of compiled engines."""
    if use.refused is not None:
        return Examined(group="cache", name="cache", state=State.FAILS, told=use.refused.rstrip("."))
    if use.mode is None:
        told = f"{use.folder}: not there yet"
    else:
        size = f"{use.n_bytes / 1e6:.1f} of {MOST_BYTES / 1e6:.0f} MB"
        told = f"{use.folder}: {use.n_files} file{'s' * (use.n_files != 1)}, {size}, {use.mode}"
    if use.writable:
        return Examined(group="cache", name="cache", state=State.OK, told=told)
    return Examined(
        group="cache",
        name="cache",
        state=State.LESS,
        told=f"{told}, and it cannot be written",
        advice="Set FAULTBOND_CACHE to a folder of your own.",
    )


def requirements() -> list[Requirement]:
    """Give what faultbond says that it needs, in that order."""
    found = []
    for text in requires(PACKAGE) or ():
        match = _REQUIREMENT.fullmatch(text.strip())
        if match is not None:
            least = re.search(r">=\s*([\d.]+)", match[2])
            found.append(Requirement(package=match[1], least=least[1] if least else "0", extra=match[3] or ""))
    return found


def _library(needed: Requirement) -> Examined:
    """Load a package that is needed, and compare its version."""
    state, told = _installed(needed)
    advice = "" if state is State.OK else f"pip install '{needed.package}>={needed.least}'"
    state = State.OK if state is State.OK else State.FAILS
    return Examined(group="library", name=needed.package, state=state, told=told, advice=advice)


def _extra(extra: str, needed: list[Requirement]) -> Examined:
    """Load the packages of an extra."""
    looks = [(item, *_installed(item)) for item in needed]
    states = {state for _, state, _ in looks}
    state = next(item for item in (State.FAILS, State.ABSENT, State.OK) if item in states)
    told = ", ".join(f"{item.package} {told}" for item, _, told in looks)
    gives = GIVES.get(extra)
    return Examined(
        group="extra",
        name=f"[{extra}]",
        state=state,
        told=f"{gives}: {told}" if gives else told,
        advice="" if state is State.OK else f"pip install '{PACKAGE}[{extra}]'",
    )


def _installed(needed: Requirement) -> tuple[State, str]:
    """Give how a package stands, and its version or what is wrong with it."""
    try:
        found = version(needed.package)
    except PackageNotFoundError:
        return State.ABSENT, "is not installed"
    if _numbers(found) < _numbers(needed.least):
        return State.FAILS, f"{found} is too old"
    name = needed.package.lower()
    try:
        import_module(MODULES.get(name, name.replace("-", "_")))
    except Exception as problem:  # whatever a package that is broken raises
        return State.FAILS, f"{found} cannot be loaded: {type(problem).__name__}: {problem}".rstrip(".")
    return State.OK, found


def _numbers(text: str) -> tuple[int, ...]:
    """Give the numbers of a version, up to the first that is none."""
    match = re.match(r"\d+(?:\.\d+)*", text)
    return tuple(int(item) for item in match[0].split(".")) if match else ()


def _abilities(found: list[Examined]) -> list[Examined]:
    """Tell what works with what was found."""
    failed = {item.group for item in found if item.state is State.FAILS}
    cache = next(item.state for item in found if item.group == "cache")
    missing = {
        READING: failed & {"library"},
        WATCHING: failed & {"library", "compiler", "cache"},
        KEEPING: set() if cache is State.OK else {"cache"},
    }
    verbs = {
        READING: "check, analyse, simulate, history",
        WATCHING: "run, demo, fit, accept, reject, generate, serve",
        KEEPING: "a model is compiled once, at its first run",
    }
    found = []
    for name, told in verbs.items():
        state = State.OK if not missing[name] else State.LESS if name == KEEPING else State.FAILS
        lacks = "" if state is State.OK else f"not yet: see {' and '.join(sorted(missing[name]))} above"
        found.append(Examined(group="ability", name=name, state=state, told=told, advice=lacks))
    return found
