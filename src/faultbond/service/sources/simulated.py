"""A plant that is simulated: the subscriber's own model, with inputs that move, noise, and a fault after a while.

The inputs are those of `healthy.csv` beside the model file, or of a recording that is named, again and again; else
those with which a generated program tries itself. The plant is simulated in stretches; where a stretch begins is in
the cursor, so that after a stop the same values come again.
"""

import asyncio
import json
import math
import time
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from faultbond.app.simulation import driving_inputs, solved_start
from faultbond.arrays import FloatArray
from faultbond.errors import FaultbondError, ModelError, RecordingError, SourceError
from faultbond.io.faults import FaultRequest
from faultbond.io.row_block import RowBlock
from faultbond.model.graph import BondGraph, Parameter
from faultbond.model.row_means import of_rows
from faultbond.service.contract.messages import Arrivals
from faultbond.service.contract.source import Subscriber
from faultbond.types import ElementType, FaultKind

HEALTHY = "healthy.csv"
ROWS = 1000  # of a stretch
TRIAL = 1200  # samples after which usual inputs begin again; two of the longest periods in which they move
USUAL_DELAY = 60.0  # s of real time before the fault that comes by itself
USUAL_SAMPLES = 60  # before it at least, beside those for which alarms are off
USUAL_PART = 0.25  # of the change that is declared of a parameter: with more the tank would run empty after hours
TICK = 0.1  # s between what goes out

Drive = tuple[FloatArray, dict[str, float]]  # inputs that come again and again, (n, n_inputs), SI; states at first


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationWishes:
    """What is asked of a simulation.

    speed: times real time; infinite: as fast as it is taken. faults: times in s since it began; None: a usual one.
    noise: whether instruments have that of the model. inputs: a recording that drives it; empty: see above.
    """

    speed: float = 1.0
    seed: int = 1
    faults: tuple[FaultRequest, ...] | None = None
    noise: bool = True
    inputs: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Begin:
    """Where a stretch begins.

    row: its first, from 0. states: by name, SI. stuck: by fault, what the instrument shows that was stuck before.
    """

    row: int
    states: Mapping[str, float]
    stuck: Mapping[str, float]


class _Plant:
    """A plant in operation, and what is going to happen to it. It computes, so it is called in a thread.

    Parameters
    ----------
    subscriber : whose model it is
    wishes : what is asked for
    drives : what drives each model, by its file and text; one that is not there yet is added
    """

    def __init__(self, subscriber: Subscriber, wishes: SimulationWishes, drives: dict[str, Drive]) -> None:
        from faultbond.simulate import fault_in_si  # noqa: PLC0415 - loads casadi and scipy

        graph = of_rows(subscriber.graph)
        self._graph, self._wishes = graph, wishes
        key = subscriber.graph.file + "\n" + subscriber.graph.text
        if key not in drives:
            drives[key] = _driven(subscriber.graph, wishes.inputs)
        self._inputs, states = drives[key]
        self.step = graph.sample_time or 1.0
        self.first = _Begin(row=0, states=states, stuck={})
        requests = _usual_fault(subscriber.graph, wishes.speed) if wishes.faults is None else wishes.faults
        self._faults = list[Any]()
        for item in requests:
            with suppress(ModelError):  # what another plant of this source has
                self._faults.append(fault_in_si(item, graph))
        self._seeds = [wishes.seed, int.from_bytes(sha256(subscriber.asset.encode()).digest()[:4], "big")]
        about = repr((subscriber.graph.text, requests, wishes.noise, self._seeds)).encode()
        self.digest = sha256(about + self._inputs.tobytes()).hexdigest()[:16]

    def stretch(self, begin: _Begin) -> tuple[FloatArray, RowBlock, _Begin]:
        """Give the times since the begin of a stretch, its rows with these, and where the next one begins."""
        from faultbond.simulate import Inputs, simulate  # noqa: PLC0415 - loads casadi and scipy

        rows = begin.row + np.arange(ROWS + 1)
        since: FloatArray = self.step * rows.astype(np.float64)
        inputs = Inputs(time=since, values=self._inputs[rows % len(self._inputs)])
        faults = [item for item in map(self._at(begin), self._faults) if item.start <= since[-1]]
        seed = int(np.random.SeedSequence([*self._seeds, begin.row]).generate_state(1)[0])
        found = simulate(self._graph, inputs, faults, seed=seed, noise=self._wishes.noise, start=begin.states)
        block = RowBlock(
            time=since[:-1],
            u=found.inputs[:-1],
            y=found.outputs[:-1],
            saturated=np.zeros(ROWS, dtype=np.intp),
            line=rows[:-1] + 1,
        )
        states = dict(zip(found.state_names, map(float, found.states[-1]), strict=True))
        return since[:-1], block, _Begin(row=begin.row + ROWS, states=states, stuck=self._stuck(found, faults))

    def _at(self, begin: _Begin) -> Any:
        """Give the function that makes of a fault what it is in a stretch.

        Of one that comes and goes, what was long before is left out; an instrument that is stuck stays where it was.
        """
        moment = begin.row * self.step

        def shifted(fault: Any) -> Any:
            if fault.on is not None and fault.off is not None and moment > fault.start:
                period = fault.on + fault.off
                start = fault.start + period * math.floor((moment - fault.start) / period)
                fault = replace(fault, start=start, end=None)
            shown = begin.stuck.get(fault.parameter)
            return fault if shown is None or fault.start > moment else replace(fault, value=shown)

        return shifted

    def _stuck(self, found: Any, faults: Sequence[Any]) -> dict[str, float]:
        """Give what the instruments show at the end that are stuck at their last value."""
        names = [item.name for item in self._graph.inputs] + [item.name for item in self._graph.sensors]
        last = np.concatenate([found.inputs[-1], found.outputs[-1]])
        return {
            item.parameter: float(last[names.index(item.instrument)])
            for item in faults
            if item.kind == FaultKind.STUCK.value and item.factor is None
        }


def _driven(graph: BondGraph, inputs: str) -> Drive:
    """Give what drives a plant."""
    beside = Path(graph.file).parent / HEALTHY
    recording = inputs or (str(beside) if beside.is_file() else "")
    rows = of_rows(graph)
    if recording:
        with suppress(*(() if inputs else (RecordingError,))):
            points, _ = driving_inputs(rows, recording)
            values = np.array([point.u for point in points])
            for item in np.array(rows.inputs, dtype=object)[~np.isfinite(values).all(axis=0)]:
                raise RecordingError(f"{recording}: input {item.name} has no value at first, and cannot drive a plant.")
            return values, solved_start(graph, recording)
    from faultbond.app.self_test import usual_inputs  # noqa: PLC0415 - loads casadi and scipy
    from faultbond.synthesis.engine import build_engine, build_model  # noqa: PLC0415 - loads casadi

    spec, _ = build_engine(graph)
    values, start = usual_inputs(build_model(graph), spec, TRIAL)
    return np.repeat(values, graph.rows_per_sample, axis=0), start


def _usual_fault(graph: BondGraph, speed: float) -> tuple[FaultRequest, ...]:
    """Give the fault that comes where none is asked for: of what resists or, where nothing does, of any suspect."""
    from faultbond.app.self_test import faulty_value  # noqa: PLC0415 - loads casadi and scipy

    kinds = {item.name: item.type for item in graph.components}
    suspects = [item for item in graph.parameters if item.suspect and item.change > 0.0]
    chosen: list[Parameter] = [item for item in suspects if kinds.get(item.owner) is ElementType.R] or suspects
    if not chosen:
        return ()
    quiet = graph.warm_up + USUAL_SAMPLES * (graph.sample_time or 1.0)
    start = max(USUAL_DELAY * (speed if math.isfinite(speed) else 1.0), quiet)
    value = chosen[0].unit.from_si(faulty_value(chosen[0], USUAL_PART))
    return (FaultRequest(parameter=chosen[0].name, value=value, factor=None, start=start, end=start),)


@dataclass(slots=True, kw_only=True)
class _Course:
    """How far the simulation of one asset has come: row of the stretch, and the stretch after it as it is computed."""

    plant: _Plant
    subscriber: Subscriber
    origin: float  # Unix s
    begin: _Begin
    at: int
    counts: dict[str, int]
    since: FloatArray
    rows: RowBlock
    then: _Begin
    first: float = 0.0  # s since the origin
    coming: "asyncio.Task[tuple[FloatArray, RowBlock, _Begin]] | None" = None

    def cursor(self) -> str:
        """Give where it stands, from which the same values come."""
        return json.dumps(
            {
                "of": self.plant.digest,
                "origin": self.origin,
                "row": self.begin.row,
                "at": self.at,
                "states": dict(self.begin.states),
                "stuck": dict(self.begin.stuck),
            }
        )

    def due(self, elapsed: float) -> Arrivals | None:
        """Give the rows of this stretch that are due so many seconds after the first; None where there are none."""
        end = int(np.searchsorted(self.since, self.first + elapsed, side="right"))
        if end <= self.at:
            return None
        part = self.rows.part(slice(self.at, end))
        self.at = end
        counts, self.counts = self.counts, {}
        return Arrivals(
            asset=self.subscriber.asset,
            rows=replace(part, time=self.origin + part.time),
            arrived=time.time(),
            cursor=self.cursor(),
            counts=counts,
        )

    async def go_on(self) -> None:
        """Go on to the next stretch, if this one is over, and let the one after it be computed."""
        if self.at < len(self.rows):
            return
        if self.coming is None:
            self.foresee()
        if self.coming is not None:
            begin = self.then
            self.since, self.rows, self.then = await self.coming
            self.begin, self.at, self.coming = begin, 0, None
        self.foresee()

    def foresee(self) -> None:
        """Let the next stretch be computed meanwhile."""
        self.coming = asyncio.create_task(asyncio.to_thread(self.plant.stretch, self.then))


class SimulatedPlant:
    """A source that simulates the models of its subscribers; it does not end.

    Parameters
    ----------
    subscribers : the plants
    wishes : what is asked of them
    shown : the address
    """

    def __init__(self, subscribers: Sequence[Subscriber], wishes: SimulationWishes, shown: str = "sim:") -> None:
        self._subscribers, self._wishes, self._shown = tuple(subscribers), wishes, shown
        self._plants: dict[str, _Plant] = {}
        self._drives: dict[str, Drive] = {}

    @property
    def address(self) -> str:
        """What the user called it."""
        return self._shown

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """Give rows at their time.

        Raises
        ------
        SourceError
            Where a plant cannot be simulated.
        """
        courses = list[_Course]()
        try:
            for item in self._subscribers:
                courses.append(await asyncio.to_thread(self._begun, item, cursors.get(item.asset, "")))
            for course in courses:
                course.foresee()
            begun, speed = time.monotonic(), self._wishes.speed
            while True:
                elapsed = (time.monotonic() - begun) * speed if math.isfinite(speed) else math.inf
                for course in courses:
                    found = course.due(elapsed)
                    if found is not None:
                        yield found
                    await course.go_on()
                await asyncio.sleep(TICK if math.isfinite(speed) else 0.0)
        except FaultbondError as error:
            raise SourceError(f"{self._shown}: {error}") from error
        finally:
            for course in courses:
                if course.coming is not None:
                    course.coming.cancel()

    def _begun(self, subscriber: Subscriber, cursor: str) -> _Course:
        """Begin a plant, or go on with it."""
        if subscriber.asset not in self._plants:
            self._plants[subscriber.asset] = _Plant(subscriber, self._wishes, self._drives)
        plant = self._plants[subscriber.asset]
        begin, origin, at, counts = plant.first, float(math.floor(time.time())), 0, dict[str, int]()
        if cursor:
            try:
                kept = json.loads(cursor)
                if kept["of"] != plant.digest:
                    raise ValueError
                begin = _Begin(row=int(kept["row"]), states=dict(kept["states"]), stuck=dict(kept["stuck"]))
                origin, at = float(kept["origin"]), int(kept["at"])
            except (ValueError, TypeError, KeyError):  # another model, or other wishes
                counts = {"begun anew": 1}
        since, rows, then = plant.stretch(begin)
        first = float(since[min(at, ROWS - 1)])
        return _Course(
            plant=plant,
            subscriber=subscriber,
            origin=origin,
            begin=begin,
            at=at,
            counts=counts,
            since=since,
            rows=rows,
            then=then,
            first=first,
        )
