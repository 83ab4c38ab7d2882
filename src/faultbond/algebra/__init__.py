"""Routes from what is known to what is sought, through time, and their closed forms.

In: a component network and a `Question`. Out: a `Route`, and its `Solution` as formula, roots and code.
Read `route`, then the packages `routes` (how one is found) and `solving` (what it gives).
"""
