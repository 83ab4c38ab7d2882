"""How routes are found: by matching in polynomial time, or through the fewest components.

In: a question to a component network. Out: the functions that fault analysis needs of a plant, each with its route.
Read `questions`, `unroll`, `matched`, `fewest`, `functions`.
"""
