"""The one exception that stops a run."""


class BusplanError(Exception):
    """Something the user can mend: bad input, bad usage, an unreadable file.

    Parameters
    ----------
    *problems
        One complete message each: what was wrong, where, the value, and what would be right.
        All problems of one input are reported together.
    """

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems
