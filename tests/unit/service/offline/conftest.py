"""Off-line desks in folders of their own."""

import asyncio
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from desk_bench import TANK, Bench
from faultbond.app.plant import WatchedPlant, find_plant
from faultbond.app.wishes import Wanted
from faultbond.service.offline.limits import OfflineLimits


@pytest.fixture(scope="session")
def tank() -> WatchedPlant:
    """The model of an asset."""
    return find_plant(TANK / "model.yaml", Wanted())


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory, tank: WatchedPlant) -> Path:
    """A cache that has the tank's engine, made by a desk."""
    folder = tmp_path_factory.mktemp("desk")
    made = Bench(OfflineLimits(folder=str(folder)), {"tank": tank})

    async def once() -> None:
        async with made.at_work():
            await made.until(await made.order())

    asyncio.run(once())
    return folder / "cache"


@pytest.fixture
def bench(tmp_path: Path, tank: WatchedPlant) -> Callable[..., Bench]:
    """Makes a desk with limits; `cache` has what is compiled."""

    def made(cache: Path | None = None, **limits: Any) -> Bench:
        folder = tmp_path / "desk"
        if cache is not None and not folder.exists():
            folder.mkdir(mode=0o700)
            shutil.copytree(cache, folder / "cache")
        return Bench(replace(OfflineLimits(folder=str(folder)), **limits), {"tank": tank})

    return made
