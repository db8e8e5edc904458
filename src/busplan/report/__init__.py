"""From results to text; nothing here prints."""
