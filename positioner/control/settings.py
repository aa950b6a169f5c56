"""What the controller is told once, from the daemon's file."""

from dataclasses import dataclass, replace
from math import nan

from config.daemon import DaemonFile, Law
from config.device import ActionName
from positioner.control.supervision import Limits
from positioner.estimation.bookkeeping import Applied, nothing_applied
from positioner.estimation.estimate import Estimate, Reason
from positioner.estimation.identification import IdentificationSettings

USUAL_NOISE = 1e-4
"""Of a position sensor whose noise nobody has said, as a share of the stroke."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What the controller is told once."""

    limits: Limits
    minimum_pa: float
    maximum_pa: float
    breakaway_pa: float | None
    excitation_limit_s: float
    identification: IdentificationSettings
    applied: Applied
    """What the law may use before anything was identified."""

    @classmethod
    def of(cls, file: DaemonFile) -> "Settings":
        """Return the settings a daemon file asks for."""
        safety, identification = file.safety, file.identification
        return cls(
            limits=Limits(
                stroke_m=file.valve.stroke_m,
                travel_margin=safety.travel_margin,
                lost_after_cycles=safety.lost_after_cycles,
                stale_after_s=safety.stale_after_s,
                heartbeat_timeout_s=safety.heartbeat_timeout_s,
                restart_tolerance_pa=1e-3 * file.pressure.maximum_pa,
                action=safety.action,
                heartbeat_action=safety.heartbeat_action,
            ),
            minimum_pa=file.pressure.minimum_pa,
            maximum_pa=file.pressure.maximum_pa,
            breakaway_pa=file.valve.breakaway_pa,
            excitation_limit_s=file.excitation.limit_s,
            identification=IdentificationSettings(
                stroke_m=file.valve.stroke_m,
                pressure_pa=file.pressure.maximum_pa - file.pressure.minimum_pa,
                position_noise_m=identification.position_noise_m or USUAL_NOISE * file.valve.stroke_m,
                pressure_noise_pa=identification.pressure_noise_pa,
                window_s=identification.window_s,
                minimum_window_s=identification.minimum_window_s,
                derivative_samples=identification.derivative_samples,
            ),
            applied=_commissioned(file.law) if file.law else nothing_applied(),
        )

    def safe_pa(self, action: ActionName, held_pa: float) -> float:
        """Return the pressure of a safe action: hold what is held, vent to the minimum, or fill to the maximum."""
        return {"hold": held_pa, "vent": self.minimum_pa, "fill": self.maximum_pa}[action]


def _commissioned(law: Law) -> Applied:
    """Return the ratios that a daemon file keeps from an earlier identification."""
    return replace(
        nothing_applied(),
        b_over_c=Estimate(law.b_over_c_pa_per_m, nan, Reason.VALID),
        k_over_c=Estimate(law.k_over_c_pa, nan, Reason.VALID),
    )
