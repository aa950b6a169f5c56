"""The settings of the controller, from the daemon's file."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt

from config.codes import Fault, Sampling
from config.daemon_file import DaemonFile, LawTable
from config.experiment_limits import ExperimentLimits
from config.extended_valve import ExtendedValve
from config.supervision_table import FaultActionName
from positioner.control.laws.boundary import LawSettings, law_named
from positioner.control.monitors import MonitorSettings
from positioner.control.permissives import ExcitationLimits
from positioner.control.staircase_excitation import StaircaseLimits
from positioner.control.supervision import Limits
from positioner.control.travel.cutoffs import Cutoffs
from positioner.control.travel.dead_band import DeadBand
from positioner.control.travel.reference_ramp import Course
from positioner.estimation.acceptance import Applied, Ratios
from positioner.estimation.landings.extended_balance import straight_law
from positioner.estimation.online import IdentificationSettings


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of the controller, SI units; they do not change while it runs."""

    limits: Limits
    monitoring: MonitorSettings
    safe_pressure_pa: float | None
    minimum_pa: float
    maximum_pa: float
    breakaway_pa: float | None
    excitation: ExcitationLimits
    identification: IdentificationSettings
    applied: Applied
    """What the law may use before anything was identified."""
    law: LawSettings
    cutoffs: Cutoffs
    course: Course | None
    """Of the reference in force to the one asked for; None: at once."""
    dead_band: DeadBand
    staircase: StaircaseLimits | None
    """Of the excitation by slides; None: it is a sine."""
    experiment: ExperimentLimits
    delivered_pa: Callable[[float], float]
    """The command, Pa, that the device can be told in place of one."""
    valve: ExtendedValve | None
    """Whose static inverse the laws work with, in place of a straight law."""

    @classmethod
    def of(cls, file: DaemonFile, valve: ExtendedValve | None = None) -> "Settings":
        """Return the settings a daemon file asks for.

        Args:
            file: the daemon's.
            valve: what `[law] valve` names, worked out: only the roof, which knows the model, can do that.
        """
        safety, identification = file.safety, file.identification
        monitoring = MonitorSettings.of(file)
        return cls(
            limits=Limits(
                stroke_m=file.valve.stroke_m,
                travel_margin=safety.travel_margin,
                lost_after_cycles=safety.lost_after_cycles,
                stale_after_s=file.stale_after_s,
                heartbeat_timeout_s=safety.heartbeat_timeout_s,
                # A device may round the command that it is told to its own digits.
                restart_tolerance_pa=max(1e-3 * file.pressure.maximum_pa, file.device.command_step_pa),
                action=safety.action,
                heartbeat_action=safety.heartbeat_action,
                actions=_actions(file, monitoring),
            ),
            monitoring=monitoring,
            safe_pressure_pa=safety.safe_pressure_pa,
            minimum_pa=file.pressure.minimum_pa,
            maximum_pa=file.pressure.maximum_pa,
            breakaway_pa=file.valve.breakaway_pa,
            excitation=_excitation(file),
            identification=IdentificationSettings(
                stroke_m=file.valve.stroke_m,
                pressure_pa=file.pressure.maximum_pa - file.pressure.minimum_pa,
                noise_std_m=identification.noise_std_m,
                # A register of whole numbers rounds: an error spread evenly over a digit.
                pressure_noise_std_pa=max(
                    identification.pressure_noise_std_pa, file.device.pressure_step_pa / sqrt(12.0)
                ),
                pressure_held=identification.pressure_held,
                sampling=Sampling.AFTER if file.samples_after else Sampling.BEFORE,
                window_s=identification.window_s,
                minimum_window_s=identification.minimum_window_s,
                derivative_window_s=identification.derivative_window_s,
            ),
            applied=Applied(_ratios(file.law) if valve is None else straight_law(valve)),
            law=law_named(file.control.law).of(_within_supply(file, valve)),
            cutoffs=_cutoffs(file),
            course=Course.of(file),
            dead_band=_dead_band(file),
            staircase=_staircase(file) if file.by_slides else None,
            experiment=_experiment(file),
            delivered_pa=file.device.delivered_pa if file.device.command_step_pa else _as_it_is,
            valve=valve,
        )

    def safe_pa(self, action: FaultActionName, held_pa: float) -> float:
        """Return the pressure of an action: what is held, the minimum (vent), the maximum (fill), the safe one.

        By hand it is what is held, until an operator writes another.
        """
        safe_pa = held_pa if self.safe_pressure_pa is None else self.safe_pressure_pa
        pressures = {"hold": held_pa, "manual": held_pa, "vent": self.minimum_pa, "fill": self.maximum_pa}
        return {**pressures, "safe": safe_pa}[action]


def _actions(file: DaemonFile, monitoring: MonitorSettings) -> dict[Fault, FaultActionName]:
    """Return the actions of the faults that have their own."""
    table = file.supervision
    own: dict[Fault, FaultActionName | None] = {
        Fault.NO_REPLY: table.sample_age.action,
        Fault.STALE: table.sample_age.action,
        Fault.IMPLAUSIBLE: table.plausibility.action,
        Fault.DCS_SILENT: table.heartbeat.action,
        **{each.fault: each.action for each in monitoring.monitors},
    }
    return {fault: action for fault, action in own.items() if action is not None}


def _within_supply(file: DaemonFile, valve: ExtendedValve | None) -> DaemonFile:
    """Return the file with its pressures narrowed to those that the extended valve's supply gives."""
    if valve is None:
        return file
    pressure = {
        "minimum_pa": max(file.pressure.minimum_pa, valve.inverse.least_pa),
        "maximum_pa": min(file.pressure.maximum_pa, valve.inverse.most_pa),
    }
    return file.model_copy(update={"pressure": file.pressure.model_copy(update=pressure)})


def _cutoffs(file: DaemonFile) -> Cutoffs:
    low, high = file.control.cutoff_low, file.control.cutoff_high
    low_m, high_m = file.valve.travel.window_m((-inf if low is None else low, inf if high is None else high))
    return Cutoffs(low_m=low_m, high_m=high_m, hysteresis_m=file.control.cutoff_hysteresis * file.valve.stroke_m)


def _dead_band(file: DaemonFile) -> DeadBand:
    asked, stroke_m = file.control.dead_band, file.valve.stroke_m
    jumps = not law_named(file.control.law).by_single_steps
    return DeadBand(stroke_m, None if asked == "auto" else asked * stroke_m, jumps)


def _staircase(file: DaemonFile) -> StaircaseLimits:
    low, high = file.valve.travel.window_m(file.excitation.travel_window)
    return StaircaseLimits(low, high, file.pressure.minimum_pa, file.pressure.maximum_pa, file.valve.stroke_m)


def _excitation(file: DaemonFile) -> ExcitationLimits:
    table = file.excitation
    low_m, high_m = file.valve.travel.window_m(table.permitted_travel or (-inf, inf))
    return ExcitationLimits(
        longest_s=table.staircase_limit_s if file.by_slides else table.limit_s,
        low_m=low_m,
        high_m=high_m,
        by_consent=table.consent,
    )


def _experiment(file: DaemonFile) -> ExperimentLimits:
    table, pressure = file.experiment, file.pressure
    low, high = table.travel_window
    # A window that reaches an end of the travel reaches the stop there, beyond which nothing but noise is read.
    low_m, high_m = file.valve.travel.window_m((low if low > 0.0 else -inf, high if high < 1.0 else inf))
    return ExperimentLimits(
        minimum_pa=pressure.minimum_pa if table.minimum_pa is None else max(pressure.minimum_pa, table.minimum_pa),
        maximum_pa=pressure.maximum_pa if table.maximum_pa is None else min(pressure.maximum_pa, table.maximum_pa),
        rate_pa_per_s=table.rate_limit_pa_per_s,
        longest_s=table.limit_s,
        low_m=low_m,
        high_m=high_m,
    )


def _ratios(law: LawTable | None) -> Ratios | None:
    if law is None or law.b_over_c_pa_per_m is None or law.k_over_c_pa is None:
        return None
    return Ratios(law.b_over_c_pa_per_m, law.k_over_c_pa, law.offset_pa)


def _as_it_is(command_pa: float) -> float:
    """Return a command of which the device's register can say every number."""
    return command_pa
