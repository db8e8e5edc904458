"""The verdict over two keys of a profile: where a design fits, where it does not, and what limits it."""
