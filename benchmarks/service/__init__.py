"""How fast and how small the parts of the service are, on this machine."""
