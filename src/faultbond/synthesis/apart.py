"""The text of a model parted: what of it decides how the core is compiled, and what it then looks up.

All but the filters ask for tables only: how many entries these have is known when that is compiled, what stands in them
when both are joined. So one compiled text serves all models that differ in numbers, as those that a fit tries. The
filters hold the laws, and of tables those of whole numbers, which say what there is to compute; so theirs serves all
models that differ in accuracies, noise and slow errors only.
"""

import re

_TABLE = re.compile(r"^static const (\w+ \w+)\[\] = (\{[^{}]*\});", re.MULTILINE)
_LAWS = re.compile(r"^#ifdef FB_HOLDS_FILTERS\n.*?^#endif\n", re.MULTILINE | re.DOTALL)  # the filters alone call them
_OURS = '__attribute__((visibility("hidden")))'  # two cores in one process have tables of the same names
_HEAD = "/* The tables of a model, compiled apart from what looks them up. */\n#include <math.h>\n#include <stdint.h>\n"


def shape_of(model: str) -> str:
    """Give `model.h` for all but the filters: without laws, and with tables declared and not filled in."""
    return _TABLE.sub(lambda found: f"extern {_declared(found)};", _LAWS.sub("", model))


def filters_of(model: str) -> str:
    """Give `model.h` for the filters: with laws and tables of whole numbers, and others declared and not filled in."""
    return _TABLE.sub(lambda found: found[0] if found[1].startswith("int ") else f"extern {_declared(found)};", model)


def tables_of(model: str) -> str:
    """Give the text that fills the tables which `shape_of` declares."""
    tables = (f"extern {_declared(found)};\n{_declared(found, '')} = {found[2]};\n" for found in _TABLE.finditer(model))
    return _HEAD + "".join(tables)


def _declared(found: re.Match[str], ours: str = f" {_OURS}") -> str:
    return f"const {found[1]}[{found[2].count(',') + 1}]{ours}"
