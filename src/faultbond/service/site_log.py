"""All assets of a site at work: rows and deeds go through them in order, and what comes of it into the store."""

import logging
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from faultbond.app.plant import WatchedPlant
from faultbond.errors import FaultbondError, ForgottenError, RecordingError, StoreError
from faultbond.io.row_block import RowBlock
from faultbond.service.asset import MOST_UNDOS, Asset, Consequence
from faultbond.service.contract.messages import DECISIONS, Action, Arrivals, Deed, NamedRecord
from faultbond.service.contract.store import Commit, Enrolment, LogPlace, LogStore

EVERY = 60.0  # s between two checkpoints of an asset
TURNS = DECISIONS | {Action.UNDO}

GiveUp = Callable[[str, Exception], None]

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class AssetPlan:
    """An asset of a site. accept: probability from which a diagnosis is accepted by rule; None: a person accepts."""

    name: str
    plant: WatchedPlant
    accept: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Done:
    """What came of an item: rows, or a deed. error: why a deed was refused; None: it was not."""

    asset: str
    outcome: Consequence
    deed: Deed | None = None
    error: FaultbondError | None = None


@dataclass(slots=True)
class _Place:
    """Where an asset stands.

    rows, deeds: of its log. kept_at: when its last checkpoint was made. is_given_up: whether it failed unforeseen, so
    that what it remembers may be half of something; nothing more goes through it, and its log ends before that.
    """

    plan: AssetPlan
    asset: Asset
    rows: int
    deeds: int
    cursor: str
    kept_at: float
    is_given_up: bool = False


class SiteLog:
    """The assets of a site, each as the store knows it.

    What `take` was given is in the store when `settle` returns. Where the store fails, `settle` raises and may be tried
    again: nothing is lost, and no more is taken until then.

    Parameters
    ----------
    plans : the assets
    store : that keeps them
    clock : gives s, for the time between checkpoints
    give_up : is told of an asset that failed unforeseen; by default it is raised
    """

    def __init__(
        self,
        plans: Iterable[AssetPlan],
        store: LogStore,
        clock: Callable[[], float] = time.monotonic,
        give_up: GiveUp | None = None,
    ) -> None:
        self._store, self._clock, self._give_up = store, clock, give_up
        self._places = {plan.name: self._restored(plan) for plan in plans}
        self._unwritten: tuple[Commit, ...] = ()

    @property
    def assets(self) -> Mapping[str, Asset]:
        """The assets by name."""
        return {name: place.asset for name, place in self._places.items()}

    @property
    def cursors(self) -> Mapping[str, str]:
        """Behind what each asset's source is to go on."""
        return {name: place.cursor for name, place in self._places.items()}

    def rows(self, asset: str) -> int:
        """Give how many rows the log of an asset has."""
        return self._places[asset].rows

    def take(self, items: Sequence[Arrivals | Deed]) -> list[Done]:
        """Pass rows and deeds on in their order, and tell what came of each; to be settled then.

        Raises
        ------
        ValueError
            Where what was taken before has not been settled.
        """
        if self._unwritten:
            raise ValueError("what was taken before has not been settled")
        done = [self._take(item) for item in items]
        parts = [self._commit(item, what) for item, what in zip(items, done, strict=True) if what.error is None]
        self._unwritten = self._with_checkpoints(parts, done)
        return done

    def settle(self) -> None:
        """Write what was taken.

        Raises
        ------
        StoreError
            Where it cannot be written now.
        """
        if self._unwritten:
            self._store.commit(self._unwritten)
            self._unwritten = ()

    def close(self) -> None:
        """Keep every asset as it stands."""
        self.settle()
        whole = {name: place for name, place in self._places.items() if not place.is_given_up}
        kept = [Commit(asset=name, checkpoint=place.asset.checkpoint()) for name, place in whole.items()]
        self._unwritten = tuple(part for part in kept if part.checkpoint is not None)
        self.settle()

    def _take(self, item: Arrivals | Deed) -> Done:
        """Pass an item on; an asset that fails is given up, and the others go on."""
        place = self._places[item.asset]
        if not place.is_given_up:
            try:
                return self._passed_on(place, item)
            except Exception as error:
                self._fails(place, error)
        told = FaultbondError(f"{item.asset}: it failed and is not watched. Restart the service once it is mended.")
        return Done(asset=item.asset, outcome=Consequence(), error=told)

    def _fails(self, place: _Place, error: Exception) -> None:
        if self._give_up is None or isinstance(error, StoreError):
            raise error
        place.is_given_up = True
        self._give_up(place.plan.name, error)

    def _passed_on(self, place: _Place, item: Arrivals | Deed) -> Done:
        if isinstance(item, Arrivals):
            outcome = place.asset.take(item.rows)
            place.rows, place.cursor = place.rows + len(item.rows), item.cursor or place.cursor
            return Done(asset=item.asset, outcome=outcome)
        deed = replace(item, rows=place.rows)
        try:
            deed, outcome = self._do(place, deed)
        except FaultbondError as error:
            return Done(asset=item.asset, outcome=Consequence(), error=error)
        place.deeds += 1
        return Done(asset=item.asset, outcome=outcome, deed=deed)

    def _do(self, place: _Place, deed: Deed) -> tuple[Deed, Consequence]:
        """Do a deed of the log, or a new one; gives it as it is to be kept."""
        if deed.action is not Action.UNDO:
            return deed, place.asset.do(deed, place.deeds)
        decided = self._last_decision(place, deed)
        *earlier, undo = place.asset.undos
        asset = Asset(place.plan.name, place.plan.plant, undo.checkpoint, accept=place.plan.accept)
        asset.turn, asset.undos = place.asset.turn + 1, tuple(earlier)
        told: list[NamedRecord] = []
        for item in self._store.log_after(deed.asset, undo.rows, undo.deeds):
            if isinstance(item, RowBlock):
                told += asset.take(item).records
            elif item.number == deed.number:  # of the log, where it is one of the past
                break
            elif item.action not in TURNS:  # decisions behind it have been taken back
                told += asset.do(item, place.deeds).records
        place.asset = asset
        return replace(deed, undone=decided.number), Consequence(records=tuple(told))

    def _last_decision(self, place: _Place, wanted: Deed) -> Deed:
        """Give the decision that is taken back first; refuse to take back another one, such as that of another."""
        if not place.asset.undos:
            raise FaultbondError(
                f"{wanted.asset}: there is no decision that can be taken back: only the latest {MOST_UNDOS} since the "
                "last alarm can be."
            )
        undo = place.asset.undos[-1]
        try:  # it is the first entry behind the state from before it
            behind = self._store.log_after(wanted.asset, undo.rows, undo.deeds)
            last = next(item for item in behind if isinstance(item, Deed))
        except ForgottenError as error:
            told = f"{wanted.asset}: rows since the last decision are forgotten, so it cannot be taken back."
            raise FaultbondError(told) from error
        if wanted.undone not in (None, last.number):
            raise FaultbondError(
                f"{wanted.asset}: entry {wanted.undone} cannot be taken back now: decisions can be, the last one "
                f"first, which is {last.number} ({last.action.value})."
            )
        return last

    @staticmethod
    def _commit(item: Arrivals | Deed, done: Done) -> Commit:
        outcome = done.outcome
        if isinstance(item, Arrivals):
            return Commit(
                asset=item.asset,
                rows=item.rows,
                arrived=item.arrived,
                cursor=item.cursor,
                curves=outcome.curves,
                records=outcome.records,
            )
        return Commit(asset=item.asset, records=outcome.records, deeds=(done.deed,) if done.deed else ())

    def _with_checkpoints(self, parts: Sequence[Commit], done: Sequence[Done]) -> tuple[Commit, ...]:
        """Add checkpoints of assets whose last one is old, or of which something was found or decided."""
        now = self._clock()
        told = {item.asset for item in done if item.deed or any(r.kind != "diagnosis" for r in item.outcome.records)}
        made = []
        for name in dict.fromkeys(part.asset for part in parts):
            place = self._places[name]
            if place.is_given_up:
                continue
            if name in told or now - place.kept_at >= EVERY:
                checkpoint = place.asset.checkpoint()
                if checkpoint is not None:
                    made.append(Commit(asset=name, checkpoint=checkpoint))
                    place.kept_at = now
        return (*parts, *made)

    def _restored(self, plan: AssetPlan) -> _Place:
        """Give an asset as its log says: from the newest checkpoint on, by what the log has behind it."""
        graph = plan.plant.graph
        label, text = plan.plant.document
        enrolment = Enrolment(
            asset=plan.name,
            model_sha256=graph.sha256,
            label=label,
            text=text,
            n_inputs=len(graph.inputs),
            n_outputs=len(graph.sensors),
        )
        known = any(item.model_sha256 != graph.sha256 for item in self._store.enrolments(plan.name))
        stand = self._store.enrol(enrolment)
        if known and not stand.rows:
            _LOG.warning("%s: its model is not that of before; a new log begins, and the old one is kept.", plan.name)
        asset, stand = _begun(plan, stand)
        place = _Place(
            plan=plan,
            asset=asset,
            rows=stand.checkpoint_rows,
            deeds=stand.checkpoint_deeds,
            cursor=stand.cursor,
            kept_at=self._clock(),
        )
        behind = (
            self._store.log_between(plan.name)  # all that is kept: old rows may be forgotten
            if stand.rows and not stand.checkpoint_rows
            else self._store.log_after(plan.name, place.rows, place.deeds)
        )
        try:
            self._repeat(place, behind)
        except Exception as error:
            self._fails(place, error)
        place.rows = stand.rows
        return place

    def _repeat(self, place: _Place, behind: Iterable[RowBlock | Deed]) -> None:
        """Let a part of the log pass once more."""
        for item in behind:
            if isinstance(item, RowBlock):
                place.asset.take(item)
                continue
            with suppress(FaultbondError):  # of another version, which may rank otherwise
                self._do(place, item)
            place.deeds += 1


def _begun(plan: AssetPlan, stand: LogPlace) -> tuple[Asset, LogPlace]:
    """Give an asset as its checkpoint has it; where that is of another version, or damaged, all of its log passes."""
    if stand.checkpoint is not None:
        try:
            return Asset(plan.name, plan.plant, stand.checkpoint, accept=plan.accept), stand
        except (RecordingError, StoreError):
            stand = replace(stand, checkpoint=None, checkpoint_rows=0, checkpoint_deeds=0)
    return Asset(plan.name, plan.plant, accept=plan.accept), stand
