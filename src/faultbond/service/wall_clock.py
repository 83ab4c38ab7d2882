"""The system's clock beside one that only grows: when it was set, and what may be believed of it."""

from collections.abc import Callable

LEAST = 2.0  # s between two looks that are a jump; a clock that is led to the right time goes 0.5 ms in each s
DOUBTED = 86400.0  # s for which a clock that was set forward is not believed where something would be forgotten by it


class WallClock:
    """Tells when the system's clock was set.

    Parameters
    ----------
    clock : gives Unix s
    steady : gives s that only grow
    """

    def __init__(self, clock: Callable[[], float], steady: Callable[[], float]) -> None:
        self._clock, self._steady = clock, steady
        self._ahead = clock() - steady()
        self._forward: list[tuple[float, float]] = []  # when it was set forward, s that only grow, and by how much
        self.n_jumps = 0

    def jumped(self) -> float:
        """Give by how many s it was set since the last look, or stood still as the machine slept; 0: it was not."""
        ahead = self._clock() - self._steady()
        moved, self._ahead = ahead - self._ahead, ahead
        if abs(moved) < LEAST:
            return 0.0
        self.n_jumps += 1
        if moved > 0.0:
            self._forward.append((self._steady(), moved))
        return moved

    def believed(self) -> float:
        """Give Unix s that are not too late where it was set forward by mistake, and lately."""
        now = self._steady()
        self._forward = [(at, moved) for at, moved in self._forward if now - at < DOUBTED]
        return self._clock() - sum(moved for _, moved in self._forward)
