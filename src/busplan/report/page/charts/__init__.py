"""The charts of a page: inline SVG in percent of its width, so that words keep their size from phone to print."""
