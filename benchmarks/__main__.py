"""`python -m benchmarks`: every benchmark that takes seconds; `benchmarks.memory` takes minutes and runs alone."""

from benchmarks import bus, cycle, estimation, physics, startup

for name, benchmark in {
    "physics": physics.report,
    "estimation": estimation.report,
    "bus": bus.report,
    "cycle": cycle.report,
    "start-up": startup.report,
}.items():
    print(f"== {name}", *benchmark(), "", sep="\n", flush=True)
