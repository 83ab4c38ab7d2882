"""What the program prints, put into the pages: `python tests/docs/insert.py`, which `make docs` calls.

A fenced block `console run` of a page is run: its commands one after the other, in a folder of the page that holds
nothing but `examples`, each followed in the block by what it printed. A block such as `yaml file=NAME` is written to a
file of that folder. All other blocks are left alone.
"""

import math
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from warnings import catch_warnings

from faultbond.cli import main as main_of_program
from faultbond.io.cache import cache_folder

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
RUN = "```console run\n"
FENCE = re.compile(r"^```(\w+)(?: ([^\n]+))?\n(.*?)^```$", flags=re.M | re.S)
NUMBER = re.compile(r"[-+\u2212]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TOLERANCE = 0.05  # of a number; the last digits depend on the processor
WIDTH = "100"


def filled(page: str, folder: Path) -> str:
    """Give a page with its commands run anew in an empty folder."""
    (folder / "examples").symlink_to(ROOT / "examples")

    def renewed(match: re.Match[str]) -> str:
        language, info, body = match[1], match[2] or "", match[3]
        if info.startswith("file="):
            (folder / info.removeprefix("file=")).write_text(body, encoding="utf-8")
        if (language, info) != ("console", "run"):
            return match[0]
        return RUN + "".join(f"$ {command}\n{output(command, folder)}" for command in commands(body)) + "```"

    return FENCE.sub(renewed, page)


def commands(body: str) -> Iterator[str]:
    """Give the commands of a console block; one that ends with a backslash goes on in the next line."""
    for match in re.finditer(r"^\$ ((?:[^\n]*\\\n)*[^\n]*)$", body, flags=re.M):
        yield match[1]


def output(command: str, folder: Path) -> str:
    """Give what a command prints, without what differs from machine to machine.

    What begins with `faultbond` runs in this process, which has loaded by now what every one would have to load anew;
    what stands behind it, such as `| grep alarm`, takes its output and its exit code.
    """
    path = f"{BIN}{os.pathsep}{os.environ['PATH']}"
    call = re.fullmatch(r"faultbond\b(.*?)((?: [|>]|;).*)?", command, flags=re.S)
    if call is not None:
        with tempfile.TemporaryDirectory() as place:
            printed = [Path(place, name) for name in ("out", "err")]
            code = called(shlex.split(call[1].replace("\\\n", " ")), folder, *printed)
            again = f"{{ cat {printed[0]}; cat {printed[1]} >&2; (exit {code}); }}{call[2] or ''}"
            text = shell(again, folder, path)
    elif command == "make demo":  # as the Makefile does it: by its path, and in the project's own folder
        text = shell(f"{BIN / 'faultbond'} demo", folder, os.defpath)
    else:
        text = shell(command, folder, path)
    text = text.replace(str(cache_folder()), "~/.cache/faultbond").replace("(zig cc)", "(cc)")
    text = text.replace(f"{BIN}/", ".venv/bin/").replace(f"{ROOT}/", "").replace(f"{folder}/", "")
    return "".join(line.rstrip() + "\n" for line in text.splitlines())


def shell(command: str, folder: Path, path: str) -> str:
    """Give what a shell prints when it runs a command in a folder."""
    done = subprocess.run(  # noqa: S602 - commands of our own pages
        command,
        shell=True,
        cwd=folder,
        env={**os.environ, "PATH": path, "COLUMNS": WIDTH},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding="utf-8",
        check=False,
    )
    return done.stdout


def called(words: list[str], folder: Path, out: Path, err: Path) -> int:
    """Call the program as its script does, in a folder, with its two outputs in files; give the exit code."""
    argv, width = sys.argv, os.environ.get("COLUMNS")
    sys.argv, os.environ["COLUMNS"] = ["faultbond", *words], WIDTH
    try:
        with (
            chdir(folder),
            redirect_stdout(out.open("w", encoding="utf-8")) as one,
            redirect_stderr(err.open("w", encoding="utf-8")) as two,
            catch_warnings(),
            one,
            two,
        ):
            return main_of_program()
    except SystemExit as leaving:  # `--help`
        return int(leaving.code or 0)
    finally:
        sys.argv = argv
        os.environ.pop("COLUMNS")
        os.environ |= {"COLUMNS": width} if width is not None else {}


def differences(shown: str, printed: str) -> list[tuple[str, str]]:
    """Give the blocks of two versions of a page that do not say the same."""
    pairs = zip(FENCE.finditer(shown), FENCE.finditer(printed), strict=True)
    return [(one[0], two[0]) for one, two in pairs if one[0].startswith(RUN) and not agree(one[0], two[0])]


def agree(shown: str, printed: str) -> bool:
    """Whether two texts have the same words in the same order, and about the same numbers."""
    one, two = _plain(shown), _plain(printed)
    if NUMBER.sub("#", one) != NUMBER.sub("#", two):
        return False
    pairs = zip(_numbers(one), _numbers(two), strict=True)
    return all(math.isclose(first, second, rel_tol=TOLERANCE, abs_tol=TOLERANCE) for first, second in pairs)


def _numbers(text: str) -> list[float]:
    return [float(number.replace("\u2212", "-")) for number in NUMBER.findall(text)]


def _plain(text: str) -> str:
    """Drop layout, lines about the engine, and what Python versions write differently in a help text."""
    kept = " ".join(line for line in text.splitlines() if not line.startswith("Engine"))
    kept = re.sub(r"(-\w) ([A-Z]+), (--[\w-]+) \2", r"\1, \3 \2", kept)
    return " ".join(re.sub("─+", " ", kept).split())


def main() -> None:
    """Renew all pages."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        if RUN in text:
            with tempfile.TemporaryDirectory() as folder:
                page.write_text(filled(text, Path(folder).resolve()), encoding="utf-8")
            print(f"renewed: {page.relative_to(ROOT)}")  # noqa: T201


if __name__ == "__main__":
    main()
