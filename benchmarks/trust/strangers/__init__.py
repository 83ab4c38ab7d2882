"""Six plants simulated with numpy alone, as a stranger would, their models, and whether `faultbond run` is right."""
