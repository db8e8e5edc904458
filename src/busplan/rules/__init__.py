"""The gate: what is wrong with a profile, one small function a rule, each with a stable code."""
