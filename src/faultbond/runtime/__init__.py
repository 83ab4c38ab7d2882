"""The on-line part: what runs beside the plant, on numbers alone; it needs numpy and nothing that knows a model."""
