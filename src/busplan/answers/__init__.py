"""Answers to questions: from the record of an analysis to blocks, and to the document of `--format json`."""
