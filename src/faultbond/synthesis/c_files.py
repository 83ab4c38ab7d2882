"""Files of C in the package that go as they are into what is generated."""

from importlib.resources import files

FLEETS = ("alone.h", "fleet.c", "fleet.h", "threads.c")  # files of the core that only fleets need
_ENDINGS = (".c", ".h", ".ld")


def sources_of(folder: str) -> dict[str, str]:
    """Give the files of C in a folder of the package, and what links them, by name, in its order."""
    items = sorted(files("faultbond").joinpath(folder).iterdir(), key=lambda item: item.name)
    return {item.name: item.read_text(encoding="utf-8") for item in items if item.name.endswith(_ENDINGS)}
