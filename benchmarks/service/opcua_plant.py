"""An OPC UA server whose variables are written each 10 ms, as a program of its own.

    python -m benchmarks.service.opcua_plant PORT SECONDS FILE

The file has the times of all rows that were written, and when each was, once `done` has been said.
"""

import asyncio
import json
import sys
import time
from datetime import UTC
from pathlib import Path

from asyncua import ua
from asyncua.server.server import Server

from benchmarks.service.ladder import STEP, recording


async def _play(port: int, seconds: float, file: Path) -> None:
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/plant")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    names, values = recording(round(seconds / STEP))
    folder = await server.nodes.objects.add_object(2, "ladder")
    nodes = [(await folder.add_variable(ua.NodeId(ua.String(name), ua.Int16(2)), name, 0.0)).nodeid for name in names]
    sent = list[tuple[float, float]]()
    async with server:
        print("ready", flush=True)  # who has started it waits for that, and says when to begin
        await asyncio.to_thread(sys.stdin.readline)
        begin = round(time.time() + STEP, 2)
        for k, row in enumerate(values):
            moment = round(begin + STEP * k, 3)
            await asyncio.sleep(moment - time.time())
            stamp = ua.DateTime.fromtimestamp(moment, UTC).replace(tzinfo=None)
            for node, value in zip(nodes, row.tolist(), strict=True):
                data = ua.DataValue(ua.Variant(value, ua.VariantType.Double), SourceTimestamp=stamp)
                await server.write_attribute_value(node, data)
            sent.append((moment, time.time()))
        file.write_text(json.dumps(sent), encoding="utf-8")
        print("done", flush=True)
        await asyncio.to_thread(sys.stdin.read)  # what is on its way is fetched; who has started it ends it


if __name__ == "__main__":
    asyncio.run(_play(int(sys.argv[1]), float(sys.argv[2]), Path(sys.argv[3])))
