"""Actuators that people have, and the one that is simulated and positioned here: one pressure against a spring.

A spring makes of each pressure a place, p = (k_s x + F_0)/A. The laws, their landings and each test on the valve rest
on that. A double-acting cylinder has two pressures and no spring, m x'' = A_1 p_1 - A_2 p_2 - friction. It rests
anywhere, and its one command is a rate. A booster is a limit of the rates at which one pressure changes.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

NEEDED: Mapping[str, str] = {
    "double_acting": "a cylinder without a spring needs a second pressure, commanded and measured, a law for their "
    "difference, and a safe state that no spring gives; allowed is spring_return",
    "booster": "a volume booster needs its rates of filling and venting, which a law must know: positioner commission "
    "prints them; with effect rate_limit of these in the valve file, write spring_return",
}
"""What each of the others would need."""


def require_actuator(actuator: Any) -> Any:
    """Return it, unless it is known and not to be had.

    Raises:
        ValueError: says what would be needed.
    """
    if isinstance(actuator, str) and actuator in NEEDED:
        raise ValueError(f"is neither simulated nor positioned: {NEEDED[actuator]}")
    return actuator


Actuator = Annotated[Literal["spring_return"], BeforeValidator(require_actuator)]
"""One pressure against a spring."""
