"""The sections that profiles of every kind of bus share."""
