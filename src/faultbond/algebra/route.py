"""A question to the component network, and a route that answers it.

A route is the set of equations that give what is sought from what is known, each with the one thing that it finds, and
the blocks in which they are solved: one after the other where a block holds one step, together where it holds several.
Source: thesis 4.2, 4.4, A.1.
"""

from dataclasses import dataclass

from faultbond.equations.component_network import SignalAt

Target = str | SignalAt  # a parameter by name, or a signal in a frame

MAX_FRAMES = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What is sought, and what is known.

    Parameters
    ----------
    targets : parameters by name, signals with their frame
    unknown : parameters whose value is not known, targets among them
    observed : signals known in every frame
    known : further signals known in one frame, such as a state at the start or a rate
    hidden : observed signals that must not be used in one frame, such as the output that is predicted
    suspended : equations that must not be used, in any frame
    frames : frames that may be opened, the newest included
    newest : frame to begin with; equations of newer frames are not used
    causal : whether signals may only be found by the component that causes them (thesis 4.2.4)
    title : in words, for a heading
    """

    targets: tuple[Target, ...]
    observed: frozenset[str]
    unknown: tuple[str, ...] = ()
    known: frozenset[SignalAt] = frozenset()
    hidden: frozenset[SignalAt] = frozenset()
    suspended: frozenset[str] = frozenset()
    frames: int = MAX_FRAMES
    newest: int = 0
    causal: bool = False
    title: str = ""

    def is_known(self, signal: SignalAt) -> bool:
        """Whether a signal needs no equation."""
        return signal not in self.hidden and (signal[0] in self.observed or signal in self.known)


@dataclass(frozen=True, slots=True, kw_only=True)
class RouteStep:
    """One equation of a route, its frame, and the signal or parameter that it finds."""

    equation: str
    frame: int
    finds: Target


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """The equations that answer a question.

    Parameters
    ----------
    steps : from what is sought to what is known
    blocks : positions in `steps`, in order of computation; several in one block are solved together
    samples : the observed values that are used, newest first
    known : the further known signals that are used
    """

    question: Question
    steps: tuple[RouteStep, ...]
    blocks: tuple[tuple[int, ...], ...]
    samples: tuple[SignalAt, ...]
    known: tuple[SignalAt, ...] = ()

    @property
    def frames(self) -> int:
        """Number of frames whose equations are used."""
        return 1 + max((step.frame for step in self.steps), default=-1)

    @property
    def observations(self) -> int:
        """Number of consecutive samples that are needed."""
        return 1 + max((frame for _, frame in self.samples), default=-1)

    @property
    def largest_block(self) -> int:
        """Number of equations that must be solved together."""
        return max((len(block) for block in self.blocks), default=0)
