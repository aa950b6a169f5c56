"""The roof: one file a command. It alone may know both towers, and each command imports what it needs when it runs.

A command is a module with `HELP`, `EXAMPLE`, `add_arguments(parser)` and `run(arguments) -> exit status`.
"""
