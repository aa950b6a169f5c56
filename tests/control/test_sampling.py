"""When a device samples is found out by the excitation, whatever `[device] sampling` says."""

from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import pytest

from config.codes import Mode, Refusal, Sampling
from config.daemon_file import DaemonFile
from positioner.control.controller_memory import Decision
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from tests.cases import few_always
from tests.control.other_plant import SEED_LIKE, OtherPlant
from tests.other_device import Parameters

PROMPT = replace(SEED_LIKE, lag_s=1e-4)
SLOPE, FRICTION_PA = PROMPT.spring_n_per_m / PROMPT.area_m2, PROMPT.coulomb_n / PROMPT.area_m2
DEVIATIONS = 3.0
BEFORE, AFTER = Sampling.BEFORE, Sampling.AFTER


@dataclass
class OnRequest:
    """A device that measures when it is asked, after the write: it shows the pressure that acts from then on."""

    plant: OtherPlant
    _held_pa: float = field(init=False)

    def __post_init__(self) -> None:
        self._held_pa = self.plant.command_pa

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plant, name)

    @property
    def pressure_pa(self) -> float:
        return self._held_pa

    def tick(self, command_pa: float) -> None:
        self.plant.tick(self._held_pa)
        self._held_pa = command_pa


@dataclass
class TakenLate:
    """What `daemon.link` makes of any device where `sampling = "after"`: its pressures a sample late."""

    plant: Any
    _shown_pa: float = field(init=False)

    def __post_init__(self) -> None:
        self.pressure_pa = self._shown_pa = self.plant.pressure_pa

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plant, name)

    def tick(self, command_pa: float) -> None:
        self.pressure_pa = self._shown_pa
        self.plant.tick(command_pa)
        self._shown_pa = self.plant.pressure_pa


class OnItsOwnClock(OtherPlant):
    """A device that samples when it likes: a command comes at a share of its period, and acts at once."""

    def __init__(self, parameters: Parameters, period_s: float, share: float) -> None:
        self._waits_s = share * period_s
        super().__init__(parameters, period_s, at_pu=0.0, noise_std_m=1e-5)

    def tick(self, command_pa: float) -> None:
        self.stem.advance(self.command_pa, self._waits_s)
        self.command_pa = command_pa
        self.stem.advance(command_pa, self._period_s - self._waits_s)
        self.sample_counter += 1
        self._measure()


def excited(
    plant: OtherPlant, said: Sampling, true: Sampling, period_s: float = 1e-3, *, held: bool = True
) -> Decision:
    """Return what S3 by a sine leaves."""
    device: Any = OnRequest(plant) if true is AFTER else plant
    file = DaemonFile.model_validate(
        {
            "valve": {"stroke_m": PROMPT.stroke_m},
            "cycle": {"pace": "device", "period_s": period_s},
            "control": {"law": "seed"},
            "identification": {"derivative_window_s": max(0.05, 10 * period_s), "pressure_held": held},
        }
    )
    settings = Settings.of(file)
    settings = replace(settings, identification=replace(settings.identification, sampling=said))
    first = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=44126.0, beta_pa=13238.0)
    cycle = virtual_cycle(file, TakenLate(device) if said is AFTER else device, first, settings)
    for _ in range(round(0.4 / period_s)):
        cycle.once()
    for _ in run_identification(cycle, 5.0, wait=False):
        pass
    return cycle.snapshot.decision


@pytest.mark.parametrize(
    ("said", "true", "period_s", "noise_std_m"),
    few_always(
        [
            (BEFORE, AFTER, 1e-3, 1e-5),
            (AFTER, BEFORE, 1e-3, 1e-5),
            (BEFORE, AFTER, 5e-3, 1e-5),
            (BEFORE, BEFORE, 1e-3, 1e-5),
            (AFTER, AFTER, 1e-3, 1e-5),
            (BEFORE, AFTER, 1e-3, 1e-4),
            (AFTER, BEFORE, 5e-3, 1e-5),
        ],
        3,
    ),
)
def test_it_is_found_out_and_what_is_applied_is_as_sure_as_it_says(
    said: Sampling, true: Sampling, period_s: float, noise_std_m: float
) -> None:
    decision = excited(OtherPlant(PROMPT, period_s, at_pu=0.0, noise_std_m=noise_std_m), said, true, period_s)
    estimates = decision.estimates
    assert decision.applied.count == 1
    assert estimates.sampling is true
    assert abs(-estimates.b_over_c.value - SLOPE) < DEVIATIONS * estimates.b_over_c.std
    assert abs(-estimates.k_over_c.value - FRICTION_PA) < DEVIATIONS * estimates.k_over_c.std


@pytest.mark.parametrize(
    ("lag_s", "period_s", "share", "held"),
    few_always(
        [
            (1e-4, 1e-3, 0.1, True),
            (1e-4, 5e-3, 0.8, False),
            (1e-4, 1e-3, 0.3, True),
            *product((1e-4, 1e-3, 5e-3), (1e-3, 5e-3), (0.2, 0.5, 0.8), (True, False)),
        ],
        2,
    ),
)
def test_a_device_on_its_own_clock_is_known_as_well_as_is_said_or_refused(
    lag_s: float, period_s: float, share: float, held: bool
) -> None:
    """Where a command acts between two samples, nobody knows; said to be linear between them, it may be held.

    a and b hang on the instant of the jump: at a tenth of a sample they were 28 deviations off, and valid.
    """
    device = OnItsOwnClock(replace(PROMPT, lag_s=lag_s), period_s, share)
    decision = excited(device, BEFORE, BEFORE, period_s, held=held)
    estimates = decision.estimates
    for each, true in ((estimates.a, PROMPT.viscous_ns_per_m), (estimates.b, PROMPT.spring_n_per_m)):
        assert not each.valid or abs(each.value + true / PROMPT.mass_kg) < DEVIATIONS * each.std
    if decision.applied.ratios is not None:
        assert abs(-estimates.b_over_c.value - SLOPE) < DEVIATIONS * estimates.b_over_c.std
        assert abs(-estimates.k_over_c.value - FRICTION_PA) < DEVIATIONS * estimates.k_over_c.std


def test_where_neither_fits_the_refusal_names_it() -> None:
    class Lags(OtherPlant):
        """Its pressure register repeats the command; the actuator follows slowly."""

        @property
        def pressure_pa(self) -> float:
            return self.command_pa

        @pressure_pa.setter
        def pressure_pa(self, _value: float) -> None:
            pass

    decision = excited(Lags(replace(PROMPT, lag_s=0.1), 1e-3, at_pu=0.0, noise_std_m=1e-5), BEFORE, BEFORE)
    assert decision.applied.ratios is None
    assert decision.applied.last_refusal is Refusal.MODEL_DOES_NOT_FIT
    assert "device.sampling" in decision.applied.last_refusal.text
