"""The timeline of a cycle in characters and as SVG."""
