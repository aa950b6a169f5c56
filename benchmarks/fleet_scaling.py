"""What `positioner fleet` takes for 100, 1 000, 10 000 recordings on 1 and 2 workers: throughput, memory, Dask's share.

    python -m benchmarks.fleet_scaling FOLDER [--recordings 100 1000 10000] [--workers 1 2]

The recordings are short (5 s at 50 Hz), ten a valve, and of valves that are as their files say, the first explained by
a look: so nearly all end at the look, which is the hardest case for whatever is paid by the task. Each line is a run
into a folder of its own, in a process of its own; what was measured is kept in `scaling.jsonl`, so that the command can
be broken off and goes on.

Seconds of processor (CPU) are told beside those of the clock, as only they mean anything on a machine that is shared:
of the client, in whose process the scheduler runs, and of its workers. Starting up is in them; what one more recording
takes is therefore told from the difference of two runs. From these follows, on paper, what 100 cores would take.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from itertools import count, pairwise
from pathlib import Path
from threading import Event, Thread

import numpy as np
import psutil

from benchmarks.kept_lines import Line, kept
from config.slave_file import Sensor
from config.valve_file import ValveFile, load_valve
from config.valve_file_writer import write_valve
from sim.composition import Composition
from workbench.blind.hiding import draw_valve
from workbench.blind.input_signal import excitation
from workbench.blind.trial import NOISE_M, Trial
from workbench.compare.comparison import compare
from workbench.data.kept_results import KeptResults
from workbench.fleet.examination import Examination, Request, examine, is_at_floor, request_key
from workbench.fleet.fleet import fleet
from workbench.fleet.tables import write_tables

SAMPLES, PERIOD_S = 251, 0.02
A_VALVE = 10
EVERY_S = 0.2
ON_PAPER = 100
MIB = 2**20


def make(folder: Path, recordings: int) -> None:
    """Write so many recordings, and the manifest of them; those that are there stay."""
    for name in ("valves", "recordings"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    rows = ["valve,file,recording,when"]
    for number in range(0, recordings, A_VALVE):
        name = f"V{number // A_VALVE:04d}"
        if not (folder / "recordings" / f"{name}-{A_VALVE - 1}.csv").exists():
            _valve(folder, name, number)
        rows += [f"{name},valves/{name}.toml,recordings/{name}-{i}.csv,2026-01-{i + 1:02d}" for i in range(A_VALVE)]
    (folder / f"plant-{recordings}.csv").write_text("\n".join([*rows, ""]))


def _valve(folder: Path, name: str, seed: int) -> None:
    """Write a valve and its recordings; not one of a slip on a knife edge, by which few samples may be off."""
    for attempt in count():
        draw = np.random.default_rng([seed, attempt])
        file = ValveFile(valve=draw_valve(draw))
        composition = Composition.from_file(file)
        trial = Trial(excitation(file.valve, draw, SAMPLES), PERIOD_S)
        clean_m = trial.answer_m(composition, composition.theta)
        sensors = [Sensor(noise_std_m=NOISE_M, seed=int(draw.integers(2**31))) for _ in range(A_VALVE)]
        made = [trial.recording(clean_m, each) for each in sensors]
        if is_at_floor(compare(made[0], file), file):
            break
    write_valve(folder / "valves" / f"{name}.toml", file)
    for i, recording in enumerate(made):
        recording.write(folder / "recordings" / f"{name}-{i}.csv")


def measured(folder: Path, recordings: int, workers: int) -> Line:
    """Return what a whole run takes, this process and its children."""
    peak, ended = {"client": 0, "worker": 0}, Event()
    here = psutil.Process()

    def watch() -> None:
        while not ended.wait(EVERY_S):
            peak["client"] = max(peak["client"], here.memory_info().rss)
            for child in here.children(recursive=True):
                try:
                    peak["worker"] = max(peak["worker"], child.memory_info().rss)
                except psutil.NoSuchProcess:
                    continue

    thread = Thread(target=watch, daemon=True)
    thread.start()
    out = folder / f"out-{recordings}-{workers}"
    began_s = time.monotonic()
    found = fleet(folder / f"plant-{recordings}.csv", out, workers=workers)
    write_tables(found.courses, out)
    wall_s = time.monotonic() - began_s
    ended.set()
    thread.join()
    times = here.cpu_times()
    return {
        "recordings": recordings,
        "workers": workers,
        "examined": found.examined,
        "complaints": len(found.complaining),
        "wall_s": wall_s,
        "client_cpu_s": times.user + times.system,
        "workers_cpu_s": times.children_user + times.children_system,
        "client_mib": peak["client"] / MIB,
        "worker_mib": peak["worker"] / MIB,
    }


def table(runs: Sequence[Line]) -> list[str]:
    """Return a line a run, then what one more recording takes."""
    ordered = sorted(runs, key=lambda each: (each["workers"], each["recordings"]))
    lines = ["workers  recordings   clock s  rec./s  client CPU s  workers' CPU s  client MiB  worker MiB  complaints"]
    lines += [
        f"{each['workers']:7}{each['recordings']:12}{each['wall_s']:10.1f}{each['recordings'] / each['wall_s']:8.1f}"
        f"{each['client_cpu_s']:14.1f}{each['workers_cpu_s']:16.1f}{each['client_mib']:12.0f}{each['worker_mib']:12.0f}"
        f"{each['complaints']:12}"
        for each in ordered
    ]
    for low, high in pairwise(ordered):
        if low["workers"] == high["workers"]:
            lines += _slope(low, high)
    return lines


def _slope(low: Line, high: Line) -> list[str]:
    more = high["recordings"] - low["recordings"]
    client_s = (high["client_cpu_s"] - low["client_cpu_s"]) / more
    worker_s = (high["workers_cpu_s"] - low["workers_cpu_s"]) / more
    kib = 1024.0 * (high["client_mib"] - low["client_mib"]) / more
    at_client, at_workers = 1.0 / client_s, ON_PAPER / worker_s
    return [
        f"{high['workers']} workers, {low['recordings']} to {high['recordings']}: one more takes the client "
        f"{1e3 * client_s:.1f} ms and {kib:.1f} KiB, a worker {1e3 * worker_s:.1f} ms",
        f"  on paper, {ON_PAPER} cores: the workers {at_workers:.0f} recordings/s, the client {at_client:.0f}",
    ]


def alone_s(folder: Path, recordings: int) -> tuple[float, float]:
    """Return what an examination, and naming and keeping it, take in one process without Dask, s of CPU each."""
    store = KeptResults(folder / "out-alone", Examination)
    rows = [row.split(",") for row in (folder / f"plant-{recordings}.csv").read_text().splitlines()[1:]]
    spent_s = np.zeros(2)
    for i, (_, valve, recording, _) in enumerate(rows):
        model = load_valve(folder / valve)
        times_s = [time.process_time()]
        found = examine(Request("", str(folder / recording), model))
        times_s.append(time.process_time())
        store.put(request_key(folder / recording, model, ""), found)
        times_s.append(time.process_time())
        spent_s += np.diff(times_s) * (i > 0)
    examined_s, kept_s = spent_s / (len(rows) - 1)
    return float(examined_s), float(kept_s)


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fleet_scaling", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recordings", type=int, nargs="+", default=[100, 1000, 10000])
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(words)
    if given.one:
        print(json.dumps(measured(given.folder, given.recordings[0], given.workers[0])))
        return
    file = given.folder / "scaling.jsonl"
    for recordings in sorted(given.recordings):
        make(given.folder, recordings)
        for workers in given.workers:
            if not any((each["recordings"], each["workers"]) == (recordings, workers) for each in kept(file)):
                command = [sys.executable, "-m", "benchmarks.fleet_scaling", str(given.folder), "--one"]
                command += ["--recordings", str(recordings), "--workers", str(workers)]
                said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
                with file.open("a") as lines:
                    lines.write(said.splitlines()[-1] + "\n")
    examined_s, kept_s = alone_s(given.folder, min(given.recordings))
    print(f"without Dask: examined in {1e3 * examined_s:.1f} ms of CPU, named and kept in {1e3 * kept_s:.1f} ms")
    print("\n".join(table(kept(file))))


if __name__ == "__main__":
    main()
