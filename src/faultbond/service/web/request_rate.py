"""How often somebody may ask for what costs much: no person is so fast, and a program that is waits."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

MOST_KEYS = 1000  # that are remembered; of more that which asked least lately is forgotten
MINUTE = 60.0  # s


@dataclass(slots=True, kw_only=True)
class RequestRate:
    """A bucket of requests for each who asks, which fills again in a minute.

    most: requests in a minute. clock: seconds that only grow.
    """

    most: int
    clock: Callable[[], float] = time.monotonic
    _left: dict[str, tuple[float, float]] = field(default_factory=dict, init=False, repr=False)

    def wait(self, key: str) -> float:
        """Take a request out of a bucket, and give 0; or for how many s it is empty."""
        now, share = self.clock(), self.most / MINUTE
        left, at = self._left.pop(key, (float(self.most), now))
        left = min(left + share * (now - at), float(self.most))
        is_empty = left < 1.0
        self._left[key] = (left if is_empty else left - 1.0, now)
        while len(self._left) > MOST_KEYS:
            del self._left[next(iter(self._left))]
        return (1.0 - left) / share if is_empty else 0.0
