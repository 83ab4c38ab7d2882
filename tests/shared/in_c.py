"""Small programs in C around files of the generated program, for tests of one of them."""

import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from faultbond.synthesis.compile import CORE

PROGRAM = Path(str(CORE)).parent / "program"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
SANITIZERS = ("-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
LANGUAGES = {"C": ("gcc", "-x", "c", "-std=c99"), "C++": ("g++", "-x", "c++", "-std=c++17")}


@cache
def small_program(text: str, language: str = "C") -> Path:
    """The program of a text around files of `program`, under sanitizers; a word of the compiler's is a failure."""
    folder = Path(mkdtemp())
    source, target = folder / "small.c", folder / "small"
    source.write_text(text)
    more = ("-Wno-unused-function", f"-I{PROGRAM}", f"-I{CORE}")  # a test takes a part of all
    command = [*LANGUAGES[language], "-O1", *WARNINGS, *SANITIZERS, *more, str(source), "-o", str(target), "-lm"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target
