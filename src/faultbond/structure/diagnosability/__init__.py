"""What the structure of a model says of its faults, on plain integers."""
