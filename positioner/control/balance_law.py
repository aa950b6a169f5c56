"""The seed's law: the pressure that balances spring and Coulomb friction at the reference.

    x'' = a x' + b x + k sign(x') + c u          (4)
    S1, moving up:    u = -(b_e r + k_e) / c_e    (23, corrected)
    S2, moving down:  u = -(b_e r - k_e) / c_e    (24, corrected)

With b/c = -k_s/A < 0 and k/c = -F_c/A < 0 the stem meets no net force at x = r when it arrives there, and the
stable valve (poles of s^2 - a s - b) brings it there by itself. Only the two ratios are needed.
"""

from positioner.estimation.acceptance import Ratios


def balance_pa(reference_m: float, direction: int, ratios: Ratios) -> float:
    """Return the pressure, Pa, that balances the stem at the reference, m, moving up (+1) or down (-1): (23), (24).

    >>> round(balance_pa(0.05, 1, Ratios(b_over_c=-800e3, k_over_c=-22e3)))
    62000
    >>> round(balance_pa(0.05, -1, Ratios(b_over_c=-800e3, k_over_c=-22e3)))
    18000
    """
    return ratios.balance_pa(reference_m, direction)
