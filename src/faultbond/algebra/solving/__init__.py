"""Routes solved: elimination, branches, closed forms, all real roots, and how much noise they amplify.

In: a route. Out: a `Solution`, printable as law, Python, C and LaTeX.
Read `problem`, `solve`, `branches`, `elimination`, `closed`, `roots`, `solution`, `formula`; below lie `polynomial`,
`symbols` and `backward_euler`; `noise` stands alone.
"""
