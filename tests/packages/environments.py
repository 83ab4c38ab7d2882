"""The packages as a user gets them: built twice, compared, and installed into empty environments. `make dist` runs it.

Each environment is new and gets the wheel with one extra or none, and what this needs, from the package index. In it
`faultbond doctor` and `faultbond demo` are run, with the system's C compiler and without one.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EPOCH = "1577836800"  # of both packages; any other fixed time would do
DONE, USER_MISTAKE, NO_VERDICT = 0, 2, 4


def built(folder: Path, source: Path = ROOT, *, umask: int = 0o022) -> tuple[Path, Path]:
    """Build the wheel and the package of sources of a tree; give their paths."""
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    environment = {**os.environ, "SOURCE_DATE_EPOCH": EPOCH}
    done = subprocess.run(
        command, cwd=source, env=environment, umask=umask, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    (wheel,), (sources,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, sources


def unpacked(sources: Path, folder: Path) -> Path:
    """Unpack a package of sources; give its tree."""
    shutil.unpack_archive(sources, folder, filter="data")
    (tree,) = folder.iterdir()
    return tree


def environment_with_nothing(folder: Path, python: str = sys.executable) -> Path:
    """Make an environment that has not even pip; give its interpreter."""
    subprocess.run([python, "-m", "venv", "--without-pip", str(folder)], check=True)
    return folder / "bin" / "python"


def install(python: Path, *words: str) -> None:
    """Install something into an environment, with the pip of this one."""
    subprocess.run([sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", *words], check=True)


def called(
    python: Path, folder: Path, *words: str, compiler: bool, cache: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Call faultbond of an environment in a folder, with or without the programs of the system."""
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "CC")}
    environment |= {"FAULTBOND_CACHE": str(cache)} if cache is not None else {}
    environment["PATH"] = f"{python.parent}{os.pathsep}{os.environ['PATH'] if compiler else ''}".rstrip(os.pathsep)
    command = [str(python), str(python.parent / "faultbond"), *words]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def tried(wheel: Path, extra: str, python: str) -> list[str]:
    """Install the wheel with an extra into an empty environment, and tell what works in it, a line each.

    Raises
    ------
    RuntimeError
        Where something does not work that should.
    """
    lines = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        begin = perf_counter()
        interpreter = environment_with_nothing(folder / "environment", python)
        install(interpreter, f"{wheel}[{extra}]" if extra else str(wheel))
        lines.append(f"  installed in {perf_counter() - begin:.0f} s")
        for compiler in (True, False):
            can = compiler or extra == "compiler"
            work = folder / ("with" if compiler else "without")
            work.mkdir()
            doctor, demo = (
                called(interpreter, work, *words, compiler=compiler, cache=work / "cache")
                for words in (("doctor", "--json", "doctor.json"), ("demo",))
            )
            codes, wanted = (doctor.returncode, demo.returncode), (DONE, DONE) if can else (NO_VERDICT, USER_MISTAKE)
            record = json.loads((work / "doctor.json").read_text(encoding="utf-8"))
            states = {item["name"]: item["state"] for item in record["checks"]}
            if codes != wanted or (extra and states[f"[{extra}]"] != "ok") or can != (work / "report.html").is_file():
                raise RuntimeError(
                    f"{codes}, not {wanted}:\n{doctor.stdout}{doctor.stderr}\n{demo.stdout}{demo.stderr}"
                )
            said = "finds the fault" if can else demo.stderr.strip()
            lines.append(f"  {'with' if compiler else 'without'} the system's compiler: demo {said}")
    return lines


def main(words: Sequence[str] | None = None) -> None:
    """Build, compare and try the packages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--into", type=Path, default=ROOT / "dist", help="folder of the packages")
    parser.add_argument("--python", nargs="+", default=[sys.executable], help="interpreters to try them with")
    parser.add_argument("--extra", nargs="*", default=["", *PROJECT["optional-dependencies"]], help="extras to try")
    wishes = parser.parse_args(words)
    shutil.rmtree(wishes.into, ignore_errors=True)
    wheel, sources = built(wishes.into)
    with tempfile.TemporaryDirectory() as place:
        again = built(Path(place, "again"), umask=0o077)
        from_sources = built(Path(place, "packages"), unpacked(sources, Path(place, "tree")))
        if any(one.read_bytes() != two.read_bytes() for one, two in zip((wheel, sources), again, strict=True)):
            raise RuntimeError("two builds give different packages")
        if wheel.read_bytes() != from_sources[0].read_bytes():
            raise RuntimeError("the wheel of the package of sources is another one than that of the tree")
    print(f"{wheel.name}, {sources.name}: built twice, the same bytes; from the sources, the same wheel")  # noqa: T201
    for python in wishes.python:
        for extra in wishes.extra:
            print(f"{python}, {f'extra {extra}' if extra else 'no extra'}:", flush=True)  # noqa: T201
            print("\n".join(tried(wheel, extra, python)), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
