"""Kinds of bus: what an analysis may ask of one, and a folder for each."""
