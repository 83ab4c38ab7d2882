"""Where live values come from.

In: the address of a source, and the columns of each asset. Out: arrivals of rows in SI. Read `simulated`,
`growing_file`, `standard_input`; `assembly`, `intake`, `queue`, `json_payload`, `mqtt`; `sparkplug_topic`,
`sparkplug_payload`, `sparkplug`; `opcua`; `options`, `opening`.
"""
