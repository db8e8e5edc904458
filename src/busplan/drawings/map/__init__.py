"""The map of a profile in characters, as SVG and PNG."""
