"""kill -9 of each process at an instant, as `make kills` does it 300 times: what is kept, and that nothing moves."""

from pathlib import Path
from random import Random

import pytest

from benchmarks.kills import KEPT, Counts, Seen, Site, kill_daemon, kill_dcs, kill_device, kill_refiner

pytestmark = [pytest.mark.patient, pytest.mark.long]


def test_whoever_is_killed_nothing_kept_is_lost_and_nothing_moves(tmp_path: Path) -> None:
    seen, counts = Seen(), Counts()
    site = Site(tmp_path, Random(0))
    try:
        for tear in (None, *KEPT):
            counts = kill_daemon(site, seen, counts, tear)
        for kill in (kill_dcs, kill_refiner, kill_device):
            kill(site, seen)
    finally:
        site.slave.close()
    assert {what: times for what, times in seen.wrong.items() if times} == {}
    assert seen.set_aside == len(KEPT)
