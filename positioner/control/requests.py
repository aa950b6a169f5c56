"""What the DCS asks for. One immutable snapshot is read once a cycle.

Events (a write of the mode, of the reference, an acknowledgement, a heartbeat) are counts that only grow, so that a
cycle takes every one, and none twice.
"""

from dataclasses import dataclass

from config.codes import Mode

Eta = tuple[int, int, int]
"""eta_1 excitation, eta_2 parameter identifier, eta_3 friction estimator: 0 switches each on."""

QUIET: Eta = (1, 1, 1)


@dataclass(frozen=True, slots=True)
class ExperimentRequest:
    """An experiment to be played: times, s, and pressures, Pa; `starts` counts, consent and veto hold while they do.

    `turn_m` is the travel from where it begins at which it retraces its way, `band_m` the travel that breaks it off; 0
    is none.
    """

    points: tuple[tuple[float, float], ...] = ()
    starts: int = 0
    consented: bool = False
    vetoed: bool = False
    turn_m: float = 0.0
    band_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Requests:
    """The DCS's side of the registers. Everything starts so that nothing moves the valve."""

    reference_m: float = 0.0
    """The stem position that `signal` asks for."""
    signal: float | None = None
    """As the DCS wrote it, 0 to 1; None: nobody has."""
    mode: Mode = Mode.HOLD
    eta: Eta = QUIET
    manual_pa: float = 0.0
    alpha_pa: float = 0.0
    beta_pa: float = 0.0
    omega_rad_per_s: float = 1.0
    reference_writes: int = 0
    mode_writes: int = 0
    manual_writes: int = 0
    acknowledgements: int = 0
    heartbeats: int = 0
    baseline_writes: int = 0
    health_resets: int = 0
    experiment: ExperimentRequest = ExperimentRequest()
