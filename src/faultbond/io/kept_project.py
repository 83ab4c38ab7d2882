"""A generated project, kept in the cache: the same model gives the same bytes, so it is made once.

Such a file is for one model file, to the byte, and for one faultbond, compiler and processor; it says so itself, and is
believed only where that is what is asked for.
"""

from contextlib import suppress
from dataclasses import dataclass

from faultbond.io.cache import read_kept, write_kept
from faultbond.io.prepared import Identity, json_line, kept_name, told_in


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectIdentity:
    """What a project is for: the plant, and what was asked for; see `generated`."""

    plant: Identity
    target: str
    lanes_at_most: int | None
    watch_only: bool

    @property
    def file(self) -> str:
        """The name of its file."""
        return kept_name(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Project:
    """A generated project.

    model : the name of the model
    lanes : filters after an alarm
    state_bytes, work_bytes, saved_bytes : of a plant, of a call, and of a plant that is saved
    test_fault : the parameter that is at fault in its self-test; None: none is
    files : paths in its folder, and texts
    """

    model: str
    lanes: int
    state_bytes: int
    work_bytes: int
    saved_bytes: int
    test_fault: str | None
    files: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kept:
    identity: ProjectIdentity
    project: Project


def read_project(identity: ProjectIdentity) -> Project | None:
    """Give what the cache has for a project; None where that is nothing, or is damaged.

    Raises
    ------
    CacheError
        Where others may write the cache.
    """
    kept = told_in(read_kept(identity.file) or b"", _Kept)
    return kept.project if kept is not None and kept.identity == identity else None


def write_project(identity: ProjectIdentity, project: Project) -> None:
    """Keep a project, where there is a cache that can be written."""
    with suppress(OSError):
        write_kept(identity.file, json_line(_Kept(identity=identity, project=project)))
