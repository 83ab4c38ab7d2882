"""Where the example plants are that come with faultbond."""

from pathlib import Path

from faultbond.errors import FaultbondError

PACKAGE = Path(__file__).parents[1]


def example(name: str) -> Path:
    """Give the folder of a built-in example: in a source tree `examples/NAME`, else the copy in the package.

    Parameters
    ----------
    name : folder name, such as `tank`

    Raises
    ------
    FaultbondError
        Where there is no such example.
    """
    for folder in (PACKAGE.parents[1] / "examples" / name, PACKAGE / "_examples" / name):
        if (folder / "model.yaml").is_file():
            return folder
    known = examples()
    if not known:
        raise FaultbondError("there are no examples in this installation. Install faultbond again.")
    raise FaultbondError(f"there is no example {name!r}. There are {', '.join(known)}.")


def examples() -> tuple[str, ...]:
    """Give the names of the built-in examples."""
    folders = (PACKAGE.parents[1] / "examples", PACKAGE / "_examples")
    return tuple(sorted({path.parent.name for folder in folders for path in folder.glob("*/model.yaml")}))
