"""Answer of `busplan sweep`: every row as text, or the top rows for people."""
