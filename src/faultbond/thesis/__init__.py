"""The thesis' own method and tables: `classic`, its printed search, its traces. One door in `app` leads here.

In: a bond graph. Out: the routes as printed (`search`, `trace`), static tables (`tables`), and the method `classic`.
Read `search` and `trace`; then `offline` (what is made of a model) and `online` (what runs beside the plant).
"""
