"""How much an analysis of what people bring may take."""

from dataclasses import dataclass

from faultbond.report.byte_size import GB, MB


@dataclass(frozen=True, slots=True, kw_only=True)
class OfflineLimits:
    """Limits of the off-line desk.

    folder: where files and jobs are kept. upload: bytes of a file that is brought. seconds: of a job, by the clock.
    processor: seconds of a processor, of each process of it. memory: bytes of address space, of each of them. results:
    bytes of a file that it writes. at_once: jobs at work. queue: jobs that wait. jobs, days: that are kept, and for how
    long, once they have ended. room: bytes of all of it.
    """

    folder: str
    upload: int = 100 * MB
    seconds: float = 600.0
    processor: float = 600.0
    memory: int = 4 * GB
    results: int = 500 * MB
    at_once: int = 1
    queue: int = 5
    jobs: int = 50
    days: float = 7.0
    room: int = 10 * GB
