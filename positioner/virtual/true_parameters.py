"""What a simulated valve's a, b, c and k really are: for judging an estimate, never for making one.

a = -F_v / m,   b = -k_s / m,   c = A / m,   k = -F_c / m
"""

from config.valve_file import ValveParameters


def truth(valve: ValveParameters) -> dict[str, float]:
    """Return the true a, b, c, k, b/c and k/c, SI units."""
    m, A = valve.mass_kg, valve.diaphragm_area_m2
    return {
        "a": -valve.viscous_ns_per_m / m,
        "b": -valve.spring_n_per_m / m,
        "c": A / m,
        "k": -valve.coulomb_n / m,
        "b_over_c": -valve.spring_n_per_m / A,
        "k_over_c": -valve.coulomb_n / A,
    }
