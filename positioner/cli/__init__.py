"""The roof: one file a command. It alone may know both towers, and each command imports what it needs when it runs.

A command is a module of its name with `HELP`, `EXAMPLE`, `add_arguments(parser)` and `run(arguments) -> exit status`;
`main` finds it. A `run` raises `InputError` for what a person gave wrong and `CommandFailed` for what could not be
done: `main` prints their one line. What several share is in `parts`.
"""
