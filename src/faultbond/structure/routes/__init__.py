"""Routes from what is known to what is sought, through time."""
