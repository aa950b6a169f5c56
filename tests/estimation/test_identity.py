"""The integral identity (8)-(12), symbolically, on a general motion.

What computes with symbols takes half a second to load: by the tests, not by every worker that only collects them.
"""


def test_corrected_identity_holds_for_any_start_and_any_friction() -> None:
    from tests.estimation.identity import a, b, c, terms

    q1, p11, p12, p13 = terms()
    assert (q1 - a * p11 - b * p12 - c * p13).expand() == 0


def test_identity_as_printed_in_10_does_not_hold() -> None:
    from tests.estimation.identity import P, a, b, c, t, terms, x

    q1, _, p12, p13 = terms()
    printed = P(-(t**3) * x, 2) + 6 * P(-(t**2) * x, 3) + 6 * P(-t * x, 4)
    assert (q1 - a * printed - b * p12 - c * p13).expand() != 0


def test_identity_with_the_coefficient_printed_in_7_does_not_hold() -> None:
    from tests.estimation.identity import P, a, b, c, t, terms, u, x

    q1, p11, _, _ = terms()
    p12 = P(-(t**3) * x, 3) + P(t**2 * x, 4)
    p13 = P(-(t**3) * u, 3) + P(t**2 * u, 4)
    assert (q1 - a * p11 - b * p12 - c * p13).expand() != 0
