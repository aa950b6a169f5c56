"""`python -m benchmarks`: every benchmark that takes seconds; `benchmarks.endurance` takes an hour and runs alone."""

from benchmarks import bus, can, cycle_time, estimation, modbus_pieces, physics, rtu_cycle, speed, startup, tls_cycle

for name, benchmark in {
    "speed against the stored runs": speed.report,
    "physics": physics.report,
    "estimation": estimation.report,
    "bus": bus.report,
    "Modbus, piece by piece": modbus_pieces.report,
    "cycle": cycle_time.report,
    "can": can.report,
    "rtu": rtu_cycle.report,
    "tls": tls_cycle.report,
    "start-up": startup.report,
}.items():
    print(f"== {name}", *benchmark(), "", sep="\n", flush=True)
