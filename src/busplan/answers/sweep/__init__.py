"""`busplan sweep`: every row as text, and the best of them for people."""
