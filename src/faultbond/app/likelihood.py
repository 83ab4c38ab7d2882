"""The likelihood of a model, as the verbs build it."""

from collections.abc import Callable
from functools import partial
from importlib import resources
from typing import TYPE_CHECKING, Any

from faultbond.fit.library import load_likelihood
from faultbond.fit.side_by_side import in_background
from faultbond.io.cache import loadable

if TYPE_CHECKING:
    from faultbond.fit.likelihood import Likelihood


def likelihood_engine(step_model: Any, *, slopes: bool = True) -> "Likelihood":
    """Build what evaluates the likelihood of a model in discrete time, perhaps without its slopes.

    Raises
    ------
    GenerationError
        Where there is no C compiler, it fails, or what was built cannot be loaded.
    """
    return begun_likelihood(step_model, slopes=slopes)()


def begun_likelihood(step_model: Any, *, slopes: bool = True) -> "Callable[[], Likelihood]":
    """Begin to build such an engine, and give what waits for it; the errors come then.

    Raises
    ------
    GenerationError
        Where there is no C compiler.
    """
    from faultbond.fit.likelihood import build_likelihood  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.compile import compile_library, required_compiler  # noqa: PLC0415 - as emit
    from faultbond.synthesis.emit import emit_filter  # noqa: PLC0415 - loads casadi

    compiler, function = required_compiler(), build_likelihood(step_model, slopes=slopes)
    template = resources.files("faultbond.synthesis").joinpath("engine.c.in").read_text()
    compiled = in_background(partial(compile_library, emit_filter(function, template), compiler))

    def loaded() -> "Likelihood":
        with loadable([compiled()]) as (path,):
            return load_likelihood(path, function)

    return loaded
