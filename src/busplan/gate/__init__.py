"""The gate: rules that check a profile, each a small function with a stable code."""
