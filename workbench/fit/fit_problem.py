"""A record to be explained, made once and handed on whole: what drives the stem, how it is sampled, when it moved."""

from collections.abc import Sequence
from dataclasses import dataclass

from config.errors import InputError
from config.valve_file import ValveParameters
from sim.composition import BASE, SPRING, Composition
from sim.effect import Effect
from workbench.data.record import Record, require_units
from workbench.fit.fit_thresholds import FIT
from workbench.fit.likelihood import Likelihood
from workbench.model.search_coordinates import AT_REST, BEHIND_POSITIONER, DEFAULT, LANDED, Parameter, free_parameters
from workbench.model.simulation_regime import NO_LANDING, Motion, Sampling, sampling
from workbench.model.told_run import ToldMove, told_moves

NO_REST = (
    "the stem creeps or moves throughout, and does not rest between moves, so that friction does not show; record "
    "steps that are held until it rests"
)
FREE = {Motion.DYNAMIC: DEFAULT, Motion.QUASI_STATIC: AT_REST, Motion.LANDINGS: LANDED}
"""What of the bare valve is fitted by default."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A record, and what of it is known before any fit."""

    record: Record
    told: tuple[ToldMove, ...]
    by: Sampling
    """How it is sampled."""
    from_pressure: bool
    """Whether the measured pressure drives the stem, and not the command."""
    load_n: float
    """To which a break-away tells static friction, N: of the valve as known before any fit, the same for all models."""
    eased: bool = False
    """Whether a stem that stops within a move goes on at F_c, as `workbench.fit.ends.settle` has found."""

    @property
    def by_setpoint(self) -> bool:
        """Whether a positioner drives the stem, by its set point."""
        return self.record.by_setpoint and not self.from_pressure

    def likelihood(
        self,
        composition: Composition,
        free: Sequence[str] | None = None,
        scale: ValveParameters | None = None,
        known: ValveParameters | None = None,
    ) -> Likelihood:
        """Return the likelihood of a valve over its free parameters, by default all that the record may tell.

        Args:
            composition: the valve.
            free: names of parameters.
            scale: as of `workbench.model.search_coordinates.free_parameters`.
            known: the same.

        Raises:
            InputError: as `free_parameters`, and of a valve that the record cannot drive.
        """
        names = self._free(composition) if free is None else free
        parameters = free_parameters(composition, names, scale, known)
        return self.likelihood_of(composition, parameters)

    def likelihood_of(self, composition: Composition, parameters: Sequence[Parameter]) -> Likelihood:
        """Return the likelihood of a valve over these parameters."""
        return Likelihood(
            composition,
            self.record,
            self.told,
            parameters,
            by=self.by,
            from_pressure=self.from_pressure,
            load_n=self.load_n,
            eased=self.eased,
        )

    def _free(self, composition: Composition) -> list[str]:
        of_effects = [
            f"{each.name}.{key}"
            for each in composition.effects
            if not (self.from_pressure and "pressure" in each.functions) and not self.by.left_out(each)
            for key, declared in each.parameters.items()
            if not declared.given
        ]
        of_base = list(BEHIND_POSITIONER if self.by_setpoint else FREE[self.by.motion])
        if composition.theta[SPRING] == 0.0 and BASE[SPRING] in of_base:
            of_base.remove(BASE[SPRING])
        return [*of_base, *of_effects]

    def require_shown(self, effects: Sequence[Effect]) -> None:
        """Refuse effects that a record sampled like this cannot show.

        Raises:
            InputError: names the effect and says why.
        """
        for each in effects:
            if why := self.by.left_out(each):
                raise InputError("recording", f"{each.name} cannot be fitted: it {why}")


def problem(
    record: Record, valve: ValveParameters, *, from_pressure: bool = False, by: Sampling | None = None
) -> Problem:
    """Return the problem of a record of a valve of which this is known; `by` in place of what the record asks for.

    Raises:
        InputError: other units than SI, or the stem moves too seldom, or one way alone.
    """
    require_units(record, valve)
    told = told_moves(record)
    by = by or sampling(record, valve)
    load_n = max(
        FIT.weights.break_away_noises * valve.spring_n_per_m * record.scale_m,
        FIT.weights.load_of_friction * valve.coulomb_n,
    )
    found = Problem(record, told, by, from_pressure, load_n)
    if not (found.by_setpoint and told and all(each.never_rests for each in told)):  # a loop shows what holds it
        _require_motion(record, told, NO_LANDING if by.slow else NO_REST)
    return found


def _require_motion(record: Record, told: Sequence[ToldMove], no_rest: str) -> None:
    """Refuse fewer moves than one each way: two slow ramps tell the balance of forces, two steps leave it wide."""
    if len(told) < 2 and 2 * sum(each.after - each.before for each in told) > len(record):
        raise InputError("recording", no_rest)
    if len(told) < 2:
        raise InputError("recording", f"the stem moves {len(told)} times, at least 2 are needed to fit anything")
    ways = {record.position_m[each.after] > record.position_m[each.before] for each in told}
    if len(ways) < 2:
        way = "opens" if ways.pop() else "closes"
        raise InputError(
            "recording", f"the stem only {way}: friction and spring cannot be told apart without both ways"
        )
