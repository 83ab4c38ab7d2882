"""Who reads what a broker of tests is told."""

import asyncio
import contextlib

import aiomqtt
from benchmarks.shared.broker import Mosquitto


class Reader:
    """Who reads what is told: topic, text, and whether the broker had kept it, of every message."""

    def __init__(self, broker: Mosquitto) -> None:
        self.port = broker.port
        self.heard: list[tuple[str, str, bool]] = []

    async def run(self) -> None:
        """Read until cancelled, also after the broker was away."""
        while True:
            with contextlib.suppress(aiomqtt.MqttError):
                async with aiomqtt.Client("127.0.0.1", self.port) as client:
                    await client.subscribe("#", qos=1)
                    async for message in client.messages:
                        self.heard.append((str(message.topic), message.payload.decode(), message.retain))
            await asyncio.sleep(0.02)

    def of(self, topic: str) -> list[str]:
        """Give the texts of a topic."""
        return [text for name, text, _ in self.heard if name == topic]
