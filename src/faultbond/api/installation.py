"""What this installation has, and what it does at first."""

from faultbond.api.options import PathLike, file_of, refuse_overwriting
from faultbond.api.told import Records, Told, heard
from faultbond.app import demonstration, installation
from faultbond.app.wishes import DEMO
from faultbond.io.examples import example


def doctor() -> Told:
    """Tell what this installation has, whether it works, and what to do where it does not.

    Example
    -------
    >>> import faultbond as fb
    >>> fb.doctor()["works"]
    True
    """
    found = heard(lambda out: installation.doctor(out=out))
    return Told(record=found[0], text=found.text)


def demo(*, report: PathLike = "report.html") -> Records:
    """Find a fault in the built-in water tank and write the report; gives the records of that run.

    Parameters
    ----------
    report : file for the report, a page of HTML

    Raises
    ------
    FaultbondError
        Where there is no C compiler, or the report cannot be written.
    """
    page = file_of(report, "report")
    refuse_overwriting([(item, "a file of the example") for item in example(DEMO).iterdir()], {"the report": page})
    return heard(lambda out: demonstration.demo(report=page, out=out))
