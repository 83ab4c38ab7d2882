"""Settings of the core that others need to know: numbers that its C headers define, each at one place."""

import re
from functools import cache
from importlib.resources import files

_DEFINED = re.compile(r"^#define (\w+) ([-+0-9.e]+)\b", re.MULTILINE)


@cache
def core_settings() -> dict[str, float]:
    """Give all numbers that the headers of the core define, by name."""
    texts = (item.read_text(encoding="utf-8") for item in files("faultbond").joinpath("core").iterdir())
    return {name: float(value) for text in texts for name, value in _DEFINED.findall(text)}
