"""The names that a generated program says: `names.h`, with all words of its records that come from the model."""

from collections.abc import Iterable
from textwrap import fill

from faultbond.contract.core_settings import core_settings
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.candidates import WORDS
from faultbond.synthesis.plan_tables import ragged_table
from faultbond.types import CheckKind, FaultKind, Method

_WIDTH = 118  # columns of a line of C
_PLAIN = range(32, 127)  # codes of letters that stand in C as they are
_MARKED = {ord('"'), ord("\\"), ord("?")}  # three letters that begin with ?? may stand for another one


def names_text(spec: EngineSpec) -> str:
    """Give `names.h`: the model's name, hash and version, and names by number, as C."""
    told = {
        "PLANT_NAME": text_literal(spec.model),
        "PLANT_SHA256": text_literal(spec.model_sha256),
        "FAULTBOND_VERSION": text_literal(spec.version),
        "METHOD_NAME": text_literal(Method.BANK.value),
        "WINDOW_FROM_START": int(core_settings()["WALKS"]),
        "N_UNTESTABLE": len(spec.explain_anything),
    }
    parts = [
        "/* What the records of this model say: names and words by number, in UTF-8. */",
        "#ifndef FB_NAMES_H",
        "#define FB_NAMES_H",
        *(f"#define {name} {value}" for name, value in told.items()),
        *_tables(spec),
        "/* Sets of parameters that are not tested, since no data could contradict them. */",
        *ragged_table("UNTESTABLE", spec.explain_anything, "PARAMETER"),
        "#endif",
    ]
    return "\n".join(parts) + "\n"


def text_literal(text: str) -> str:
    """Give a text as C writes it, in UTF-8; what is no plain letter by its octal code."""
    return '"' + "".join(_letter(code) for code in text.encode()) + '"'


def _letter(code: int) -> str:
    if code in _MARKED:
        return f"\\{code:c}"
    return f"{code:c}" if code in _PLAIN else f"\\{code:03o}"


def _tables(spec: EngineSpec) -> Iterable[str]:
    yield _texts("PARAMETER_NAMES", (item.name for item in spec.parameters))
    yield _texts("PARAMETER_COMPONENTS", (item.component for item in spec.parameters))
    yield _texts("INPUT_NAMES", (item.name for item in spec.inputs))
    yield _texts("OUTPUT_NAMES", (item.name for item in spec.outputs))
    yield _texts("PART_NAMES", spec.parts)
    yield _texts("SIGNAL_NAMES", spec.checked(CheckKind.SIGNAL))
    yield _texts("KIND_WORDS", (kind.value for kind in FaultKind))
    yield _texts("CHECK_WORDS", (kind.value for kind in CheckKind))
    yield _texts("INSTRUMENT_WORDS", WORDS)


def _texts(name: str, texts: Iterable[str]) -> str:
    """Give a table of texts; an empty one where there is none."""
    entries = ",\0".join(map(text_literal, texts)) or '""'
    lines = fill(
        f"static const char *const {name}[] = {{{entries}}};".replace(" ", "\1").replace("\0", " "),
        _WIDTH,
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return lines.replace("\1", " ")
