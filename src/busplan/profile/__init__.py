"""Profiles: their schema, their TOML text, and the place of every key."""
