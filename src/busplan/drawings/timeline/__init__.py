"""The timeline of a cycle: drawn for the terminal, as SVG, PNG and Mermaid, and as plain data."""
