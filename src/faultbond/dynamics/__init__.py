"""Right-hand sides and the discrete-time step: the only place where laws become numbers."""
