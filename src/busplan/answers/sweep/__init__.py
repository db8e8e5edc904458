"""`busplan sweep`: rows as text, the best of them for people, and a figure."""
