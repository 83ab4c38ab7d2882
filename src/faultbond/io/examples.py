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
    raise FaultbondError(f"The example {name!r} is not part of this installation. Install faultbond again.")
