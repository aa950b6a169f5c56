"""`positioner extend`: adds effects to a valve file, refits, says how the error fell."""

import argparse
from pathlib import Path

HELP = "add effects to a valve file, refit it, and print the held-out error before and after"
EXAMPLE = "positioner extend seed --effect backlash --fit rec.csv -o new.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("valve", metavar="VALVE.toml", help="a valve file, or a shipped valve's name")
    parser.add_argument("--effect", nargs="+", required=True, metavar="NAME", help="added together")
    parser.add_argument("--fit", type=Path, required=True, metavar="REC", help="a recording")
    parser.add_argument("--test", type=Path, metavar="REC", help="held out (the last third of the recording)")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="NEW.toml")
    parser.add_argument("--seed", type=int, default=0, help="of the searches (0)")


def run(arguments: argparse.Namespace) -> int:
    """Extend and write the new file with its journal; 0 if the held-out error falls, else 1."""
    from config.recording import Recording
    from config.valve import find_valve, load_valve
    from config.writing import valve_toml
    from positioner.cli.parts.naming import naming
    from positioner.cli.parts.progress import show
    from workbench.extension import extend
    from workbench.journal import Journal

    path = find_valve(arguments.valve)
    valve, recording = load_valve(path), Recording.read(arguments.fit)
    test = Recording.read(arguments.test) if arguments.test else None
    with naming({"recording": str(arguments.fit), "valve file": arguments.valve}):
        extension = extend(recording, valve, arguments.effect, test=test, seed=arguments.seed, progress=show)
    journal = Journal.beside(path).followed_by(extension)
    remarks = "".join(f"# {remark}\n" for remark in journal.remarks)
    arguments.out.write_text(remarks + valve_toml(extension.valve), encoding="utf-8")
    journal.write_beside(arguments.out)
    step = journal.steps[-1]
    print(f"{'error, mm rms':<42}{'fitted':>10}{'held out':>10}")
    for what, train_m, test_m in (
        ("as given", step.given_train_rmse_m, step.given_test_rmse_m),
        ("refitted, nothing added", step.refitted_train_rmse_m, step.refitted_test_rmse_m),
        (f"with {', '.join(step.effects)}", step.extended_train_rmse_m, step.extended_test_rmse_m),
        ("floor: what no model undercuts", step.floor_m, step.floor_m),
    ):
        print(f"{what:<42}{1e3 * train_m:>10.4f}{1e3 * test_m:>10.4f}")
    for name, each in extension.extended.parameters.items():
        outside = "" if each.physical else "   not physical: the recording wants it beyond its range"
        print(f"  {name} = {each.value:.6g} (std {each.std:.2g}){outside}")
    print(f"{arguments.out}: {step.why}")
    return 0 if extension.falls else 1
