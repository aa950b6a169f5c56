"""The law of a name: the folder of that name in `positioner/control/laws/`."""

from importlib import import_module

from positioner.control.laws.boundary import LawSettings


def law_named(name: str) -> type[LawSettings]:
    """Return the class of a law's settings; which names there are, `config.law_names` says."""
    settings: type[LawSettings] = import_module(f"positioner.control.laws.{name}").Settings
    return settings
