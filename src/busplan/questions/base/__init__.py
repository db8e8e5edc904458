"""Shared by public functions: the base of answers, and profiles as arguments."""
