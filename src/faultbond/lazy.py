"""Names of a package that are loaded when they are asked for, so that the command line starts without all the rest.

Source: PEP 562.
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module


def lazily(package: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """Give the `__getattr__` of a package whose names live in some of its modules.

    Parameters
    ----------
    package : its name
    homes : for each module, as seen from the package, the names that live there, parted by blanks
    """
    home = {name: f"{package}.{module}" for module, names in homes.items() for name in names.split()}

    def get(name: str) -> object:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        found = getattr(import_module(home[name]), name)
        setattr(sys.modules[package], name, found)
        return found

    return get
