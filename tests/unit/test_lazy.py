"""Names that are loaded when they are asked for."""

import subprocess
import sys
from importlib import import_module

import pytest

LAZY = ("faultbond", "faultbond.app", "faultbond.io", "faultbond.report")


@pytest.mark.parametrize("package", LAZY)
def test_every_name_of_a_package_is_there(package: str) -> None:
    """Each name that a package lists can be had, and is that of the module in which it was written."""
    module = import_module(package)
    for name in module.__all__:
        found = getattr(module, name)
        assert getattr(found, "__name__", name) == name
    with pytest.raises(AttributeError, match=f"'{package}' has no attribute 'nothing'"):
        module.nothing  # noqa: B018


def test_help_loads_no_large_library() -> None:
    """What the program says of itself needs neither numpy nor anything larger."""
    code = (
        "import sys; from faultbond.cli import build_parser; build_parser().format_help(); print(sorted(sys.modules))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    for library in ("numpy", "scipy", "casadi", "sympy", "rich", "pint", "ruamel"):
        assert f"'{library}'" not in loaded, library
