"""A test bench for FMUs: instances of one, run by FMPy sample by sample."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

GETTERS = {  # FMPy's names by the element of modelDescription.xml, those of FMI 2 first
    **{"Real": "getReal", "Integer": "getInteger", "Boolean": "getBoolean", "String": "getString"},
    **{"Float64": "getFloat64", "Int64": "getInt64"},
}


class Bench:
    """An FMU that was unpacked. `messages`: what its instances logged."""

    def __init__(self, archive: Path, folder: Path) -> None:
        self.fmpy = pytest.importorskip("fmpy", reason="FMPy, which runs FMUs, is not installed")
        self.about: Any = self.fmpy.read_model_description(str(archive))
        self.fmi = int(self.about.fmiVersion[0])
        self.folder = self.fmpy.extract(str(archive), str(folder))
        self.messages: list[str] = []
        self.variables = {item.name: item for item in self.about.modelVariables}

    @property
    def step(self) -> float:
        """The sample time, s."""
        return float(self.about.defaultExperiment.stepSize)

    def instance(self, *, time: float = 0.0, begun: bool = True) -> "Bird":
        """Give a new instance, which has begun at a time if it is to."""
        about = {"guid": self.about.guid, "modelIdentifier": self.about.coSimulation.modelIdentifier}
        made = (self.fmpy.fmi2.FMU2Slave if self.fmi == 2 else self.fmpy.fmi3.FMU3Slave)(
            instanceName="one", unzipDirectory=self.folder, **about
        )
        made.instantiate(**self._listening())
        bird = Bird(made, self)
        if begun:
            bird.begin(time)
        return bird

    def _listening(self) -> dict[str, Any]:
        """Give what an instance is made with, so that it logs here."""

        def heard(*told: Any) -> None:
            self.messages.append(told[-1].decode())

        if self.fmi == 3:
            return {"logMessage": heard}
        fmi2 = self.fmpy.fmi2
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(heard)
        return {"callbacks": callbacks}


class Bird:
    """One instance."""

    def __init__(self, made: Any, bench: Bench) -> None:
        self.made, self.bench, self.time = made, bench, 0.0

    def begin(self, time: float) -> None:
        """Initialize it."""
        self.time = time
        if self.bench.fmi == 2:
            self.made.setupExperiment(startTime=time)
            self.made.enterInitializationMode()
        else:
            self.made.enterInitializationMode(startTime=time)
        self.made.exitInitializationMode()

    def tell(self, values: Mapping[str, float]) -> None:
        """Set inputs by name."""
        numbers = [self.bench.variables[name].valueReference for name in values]
        (self.made.setReal if self.bench.fmi == 2 else self.made.setFloat64)(numbers, list(values.values()))

    def go(self, steps: float = 1) -> None:
        """Make a communication step of so many samples."""
        self.made.doStep(self.time, steps * self.bench.step)
        self.time += steps * self.bench.step

    def ask(self, *names: str) -> list[Any]:
        """Give variables by name."""
        return [self._value(self.bench.variables[name]) for name in names]

    def all(self) -> dict[str, Any]:
        """Give all outputs by name."""
        return {name: self._value(item) for name, item in self.bench.variables.items() if item.causality == "output"}

    def _value(self, item: Any) -> Any:
        of_type = item.type if item.type != "Enumeration" else {2: "Integer", 3: "Int64"}[self.bench.fmi]
        value = getattr(self.made, GETTERS[of_type])([item.valueReference])[0]
        return value.decode() if isinstance(value, bytes) else value
