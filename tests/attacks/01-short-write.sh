# Row 1: a file that takes a part of the page, to a Python that does not buffer.
# exits: 2
# says: standard output cannot be written: File too large
(ulimit -f 8; PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1 busplan report p.toml --no-circle > page.html)
