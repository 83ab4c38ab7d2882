"""Tells others what the service finds: a broker, other programs over HTTP, an OPC UA client, and who measures.

In: records of the store, each behind the place that a sink has among them, and how assets stand. Out: messages. Nothing
here can delay or end the watching. Read `options`, `opening`, `outbox`, `delivery`, `mqtt`, `webhook`, `measures`,
`openmetrics`.
"""
