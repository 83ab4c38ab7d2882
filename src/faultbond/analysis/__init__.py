"""What a plant's faults can be told by: which sets of suspects are testable, which look alike, what would help."""
