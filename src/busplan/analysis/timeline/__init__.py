"""One cycle as events, one behind the other."""
