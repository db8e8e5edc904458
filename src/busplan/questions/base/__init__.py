"""Foundations of all questions: the base class of answers, arguments and sentences."""
