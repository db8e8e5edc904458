"""`busplan report`: all of one or several profiles on one page, in HTML and in Markdown, from the same content."""
