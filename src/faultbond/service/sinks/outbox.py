"""The records that a sink has not told yet: they stay in the store, which also keeps how far the sink has come."""

import threading

from faultbond.service.contract.messages import NamedRecord
from faultbond.service.contract.store import LogStore

AT_ONCE = 50  # records that are read together, so that nobody waits long for the store


class Outbox:
    """Records behind a place, from the oldest on; called by one thread at a time.

    behind: how many wait, about.

    Parameters
    ----------
    name : of the reader
    store : that has the records
    lock : of the store
    """

    def __init__(self, name: str, store: LogStore, lock: threading.Lock) -> None:
        self._name, self._store, self._lock = name, store, lock
        with lock:
            self._place, newest = store.reader(name)
        self._kept, self.behind = self._place, newest - self._place

    @property
    def is_kept(self) -> bool:
        """Whether the store knows how far the sink has come."""
        return self._kept == self._place

    def waiting(self) -> list[tuple[int, NamedRecord]]:
        """Give some records that wait, the oldest first, each with its number; none: nothing waits.

        Raises
        ------
        StoreError
            Where they cannot be read.
        """
        with self._lock:
            found = self._store.records_behind(self._place, AT_ONCE)
        if len(found) < AT_ONCE:
            self.behind = len(found)
        return found

    def pass_by(self, number: int) -> None:
        """Let what is up to a record be told."""
        self._place = number
        self.behind = max(self.behind - 1, 0)

    def keep(self) -> None:
        """Let the store know how far the sink has come.

        Raises
        ------
        StoreError
            Where that cannot be written.
        """
        place = self._place
        with self._lock:
            self._store.advance(self._name, place)
        self._kept = place
