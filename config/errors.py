"""Errors for people: each is a single line."""


class InputError(Exception):
    """Bad input from a person: names file, key, value and what is allowed.

    Commands print it as one line on standard error and exit with status 2.
    """

    def __init__(self, source: str, problem: str) -> None:
        super().__init__(f"{source}: {problem}")
        self.source = source
        self.problem = problem

    def __reduce__(self) -> tuple[type["InputError"], tuple[str, str]]:
        """Pass between processes, as what a worker could not do is told by another."""
        return type(self), (self.source, self.problem)


class CommandFailed(Exception):
    """What a command was asked does not hold, or could not be done: it prints the one line, exit status 1."""
