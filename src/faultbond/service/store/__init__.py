"""Where the service keeps what must not be lost.

In: what came of arrivals and what people did. Out: the same, after any stop. Read `opening`, `address`, `relational`,
`database`, `sqlite`, `postgresql`, `chunks`, `peaks`, `tail`, `retention`, `checkpoints`, `reserve_file`, `lock`.
"""
