"""Static networks: what explains their observations."""
