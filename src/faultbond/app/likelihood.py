"""The likelihood of a model, as the verbs build it."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from faultbond.fit.library import load_likelihood
from faultbond.fit.side_by_side import in_background
from faultbond.io.cache import loadable

if TYPE_CHECKING:
    from faultbond.fit.likelihood import Likelihood


def likelihood_engine(step_model: Any) -> "Likelihood":
    """Build what evaluates the likelihood of a model in discrete time.

    Raises
    ------
    GenerationError
        Where there is no C compiler, it fails, or what was built cannot be loaded.
    """
    return begun_likelihood(step_model)()


def begun_likelihood(step_model: Any, fewer: int = 1) -> "Callable[[], Likelihood]":
    """Begin to build such an engine, and give what waits for it; the errors come then.

    fewer: in how many times fewer parts a step is taken; how many do to compare models `fit.coarse_step` tells

    Raises
    ------
    GenerationError
        Where there is no C compiler.
    """
    from faultbond.equations.step import build_step_model  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.compile import compile_library, required_compiler  # noqa: PLC0415 - as the text
    from faultbond.synthesis.likelihood_text import likelihood_text  # noqa: PLC0415 - loads casadi

    compiler, plant = required_compiler(), step_model.plant
    text = likelihood_text(build_step_model(plant, all_inputs=True), fewer=fewer)
    compiled = in_background(partial(compile_library, text, compiler, brief=True))

    def loaded() -> "Likelihood":
        with loadable([compiled()]) as (path,):
            return load_likelihood(path, len(plant.graph.sensors))

    return loaded
