"""Names of a package that are loaded when they are asked for, so that the command line starts without all the rest.

Source: PEP 562, and "Customizing module attribute access" of the Python reference.
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from types import ModuleType


def lazily(package: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """Give the `__getattr__` of a package whose names live in some of its modules.

    Parameters
    ----------
    package : its name
    homes : for each module, as seen from the package, the names that live there, parted by blanks
    """
    home = {name: f"{package}.{module}" for module, names in homes.items() for name in names.split()}

    class Package(ModuleType):
        """A package that gives its names, also where a package in it is called so, which imports would put there."""

        def __setattr__(self, name: str, value: object) -> None:
            if name not in home or not isinstance(value, ModuleType):
                super().__setattr__(name, value)

        def __dir__(self) -> list[str]:
            return sorted({*home, *(name for name in self.__dict__ if name.startswith("__"))})

    sys.modules[package].__class__ = Package

    def get(name: str) -> object:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        found = getattr(import_module(home[name]), name)
        setattr(sys.modules[package], name, found)
        return found

    return get
