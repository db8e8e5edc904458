"""Sentences, tables and drawings that several questions share."""
