"""The timeline of a cycle in characters, as SVG, PNG and Mermaid."""
