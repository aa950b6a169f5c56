"""A plant of a test's own under the daemon's law, in virtual time."""

from dataclasses import replace

from config.codes import InhibitReason, Mode
from config.daemon_file import DaemonFile
from drivers.in_memory import Plant
from positioner.control.controller_memory import Decision
from positioner.control.requests import QUIET, Requests
from positioner.daemon.health import Health
from positioner.daemon.health.valve_health import HealthSettings
from positioner.estimation.landings.static_law import StaticLaw
from positioner.virtual.virtual_cycle import virtual_cycle


def assert_static_law(law: StaticLaw, slope_pa_per_m: float, up_pa: float, down_pa: float) -> None:
    """Assert that what was found is the truth, by its own deviations, and that these are small."""
    for found, true in ((law.slope, slope_pa_per_m), (law.up, up_pa), (law.down, down_pa)):
        assert found.std < 5e-3 * abs(true)
        assert abs(found.value - true) < 3.0 * found.std


class VirtualLoop:
    """A daemon's file and a plant."""

    def __init__(self, file: DaemonFile, plant: Plant) -> None:
        self.plant = plant
        self.stroke_m, self.period_s = file.valve.stroke_m, file.cycle.period_s
        self.cycle = virtual_cycle(file, plant, Requests(mode=Mode.AUTOMATIC, mode_writes=1))
        self.cycle.health = self.health = Health(HealthSettings.of(file.health, self.stroke_m))

    def cycles(self, for_s: float) -> None:
        for _ in range(round(for_s / self.period_s)):
            self.cycle.once()

    def begin(self) -> None:
        """Ask for S3."""
        self.cycle.requests = replace(self.cycle.requests, eta=(0, 0, 0))

    def end(self) -> None:
        self.cycle.requests = replace(self.cycle.requests, eta=QUIET)
        self.cycles(self.period_s)

    def refer_to(self, reference_pu: float, for_s: float) -> None:
        """Write a reference, a share of the stroke, and let it be followed."""
        before = self.cycle.requests
        self.cycle.requests = replace(
            before, reference_m=reference_pu * self.stroke_m, reference_writes=before.reference_writes + 1
        )
        self.cycles(for_s)

    @property
    def decision(self) -> Decision:
        """The last one."""
        return self.cycle.snapshot.decision

    @property
    def why(self) -> InhibitReason:
        return self.decision.inhibit_reason
