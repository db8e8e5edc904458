"""What to set, and the cheapest change that makes a network fit."""
