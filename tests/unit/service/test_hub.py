"""Who listens gets all, in order; who is slow is cut off."""

import asyncio

from faultbond.service.hub import Hub


async def heard(hub: Hub, most: int, slow: asyncio.Event | None = None) -> list[int]:
    """Listen to the end; `slow`: only once this is set."""
    found = []
    async for _, content in hub.listen(most):
        if slow is not None:
            await slow.wait()
        found.append(content["n"])
    return found


def test_all_hear_all_and_the_slow_one_is_cut_off() -> None:
    """One that takes nothing gets what had waited for it, and no more; the others miss nothing."""

    async def play() -> None:
        hub, slow = Hub(), asyncio.Event()
        quick = [asyncio.create_task(heard(hub, 10)) for _ in range(3)]
        late = asyncio.create_task(heard(hub, 10, slow))
        await asyncio.sleep(0)
        assert hub.n_listeners == 4
        for n in range(50):
            hub.publish("number", {"n": n})
            await asyncio.sleep(0)
        assert (hub.n_listeners, hub.n_cut_off) == (3, 1)
        slow.set()
        hub.close()
        assert [await task for task in quick] == [list(range(50))] * 3
        assert await late == list(range(11))

    asyncio.run(asyncio.wait_for(play(), 20))


def test_who_leaves_is_forgotten() -> None:
    """A task that is cancelled while it listens leaves nothing behind."""

    async def play() -> None:
        hub = Hub()
        task = asyncio.create_task(heard(hub, 10))
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert hub.n_listeners == 0

    asyncio.run(asyncio.wait_for(play(), 20))
