"""The manual: pages in no format, and how a man page and a Markdown reference are made of them."""
