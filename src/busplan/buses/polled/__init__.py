"""Buses whose master asks its nodes one by one, with their protocols."""
