"""Where a figure comes from: every step to it, and everything it starts from."""
