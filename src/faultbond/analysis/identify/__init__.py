"""Parameters and noise of a plant from healthy recordings, and what the model gets wrong there."""
