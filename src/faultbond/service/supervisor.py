"""Parts of the service that may fail: each is begun anew, later and later, and given up where it fails too often.

What is foreseen, such as a broker that is not there, a part waits out by itself. What comes here is not: a defect of
faultbond, of a package, or a limit of the machine.
"""

import asyncio
import time
import traceback
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass

from faultbond.service.contract.part import ServicePart


@dataclass(frozen=True, slots=True, kw_only=True)
class RestartPolicy:
    """How often a part may fail, as the restart intensity of a supervisor of Erlang/OTP.

    most: restarts within a time, s; the failure after these is the last. delay: s before the first of them; each waits
    twice as long as the one before it in that time, up to the longest.

    Example
    -------
    >>> policy = RestartPolicy(most=3, within=60.0, delay=1.0)
    >>> [policy.delay_after(failures) for failures in ([0.0], [0.0, 10.0], [0.0, 10.0, 20.0, 30.0], [0.0, 90.0])]
    [1.0, 2.0, None, 1.0]
    """

    most: int = 5
    within: float = 600.0
    delay: float = 2.0
    longest: float = 60.0

    def delay_after(self, failures: Sequence[float]) -> float | None:
        """Give for how long to wait after the last of some failures, s; None: no longer, the part is given up.

        Parameters
        ----------
        failures : when it failed, s, ascending; one at least
        """
        lately = sum(failures[-1] - at <= self.within for at in failures)
        if lately > self.most:
            return None
        return float(min(self.delay * 2.0 ** (lately - 1), self.longest))


async def supervise(
    work: Callable[[], Awaitable[None]],
    part: ServicePart,
    *,
    policy: RestartPolicy | None = None,
    clock: Callable[[], float] = time.time,
    steady: Callable[[], float] = time.monotonic,
) -> None:
    """Do the work of a part until it ends or is given up; what is raised in it begins it anew.

    Parameters
    ----------
    work : begins the work; it says by `part.works` when it works
    part : is told how it stands
    policy : how often it may fail
    clock : gives Unix s
    steady : gives s that only grow, which are compared
    """
    policy, known = policy or RestartPolicy(), set[str]()
    failures = deque[float](maxlen=policy.most + 1)
    while True:
        try:
            await work()
        except Exception as error:  # whatever it is, the other parts go on
            failures.append(steady())
            delay = policy.delay_after(failures)
            place = f"{type(error).__name__} {traceback.extract_tb(error.__traceback__)[-1:]}"
            part.breaks(error, clock(), is_over=delay is None, is_known=place in known)
            known.add(place)
        else:
            return
        if delay is None:
            return
        await asyncio.sleep(delay)
        part.restarts += 1
