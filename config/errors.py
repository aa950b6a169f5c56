"""The one error for bad input: a single line that names file, key, value and what is allowed."""


class InputError(Exception):
    """Bad input from a person: a file, a key in it, a command-line value.

    Commands print it as one line on standard error and exit with status 2.
    """

    def __init__(self, source: str, problem: str) -> None:
        super().__init__(f"{source}: {problem}")
        self.source = source
        self.problem = problem
