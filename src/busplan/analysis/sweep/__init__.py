"""The same figures over a grid of values."""
