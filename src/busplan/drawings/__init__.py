"""Drawings: what a chart shows, as SVG and in characters."""
