"""The timeline of a cycle: drawn in characters, as SVG, PNG and Mermaid."""
