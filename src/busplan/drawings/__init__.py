"""Drawings: what a chart shows, as SVG, in characters, in Mermaid, or by matplotlib."""
