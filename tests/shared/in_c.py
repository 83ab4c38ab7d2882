"""Small programs in C around files of the generated program, for tests of one of them."""

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from compiled_once import compiled_once
from faultbond.synthesis.compile import CORE

PROGRAM = Path(str(CORE)).parent / "program"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow,bounds-strict", "-fno-sanitize-recover=all")
LANGUAGES = {"C": ("gcc", "-x", "c", "-std=c99"), "C++": ("g++", "-x", "c++", "-std=c++17")}


@cache
def small_program(text: str, language: str = "C") -> Path:
    """The program of a text around files of `program`, under sanitizers; a word of the compiler's is a failure."""
    more = ("-Wno-unused-function", f"-I{PROGRAM}", f"-I{CORE}")  # a test takes a part of all
    return compiled_once(
        text, Path(mkdtemp()) / "small", [*LANGUAGES[language], "-O1", "-g", *WARNINGS, *SANITIZERS, *more]
    )
