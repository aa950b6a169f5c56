"""The published package `stictionanalyser` on the open benchmark's cases, by an interpreter of its own:

    python -m venv theirs && theirs/bin/pip install "numpy<2" "matplotlib<3.10" "pandas<3" scipy scikit-image \
        "opencv-python-headless<4.11" && theirs/bin/pip install --no-deps stictionanalyser==0.0.21
    theirs/bin/python benchmarks/seeq_stiction.py CASES theirs.csv
    positioner bench CASES --judge theirs.csv

It draws OP over the control error, cycle by cycle, and asks each picture whether it is an ellipse with a corner. The
score is the share of a loop's cycles that are, 0 where it finds no oscillation. Its method asks neither its vendor's
server nor its buttons; the packages for those are stood in for by empty ones.
"""

import contextlib
import csv
import io
import sys
import warnings
from collections import defaultdict
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock

NAME = "stictionanalyser"
BUTTONS = ("seeq.spy", "ipyvuetify", "ipywidgets", "IPython.display")


def method(folder: Path) -> Any:
    """Return the package's function, of a folder that holds `seeq/addons`."""
    for name, path in (("seeq", folder / "seeq"), ("seeq.addons", folder / "seeq/addons")):
        sys.modules[name] = ModuleType(name)
        sys.modules[name].__path__ = [str(path)]
    inner = ModuleType("seeq.addons.stictionanalyser")
    inner.__path__ = [str(folder / "seeq/addons/stictionanalyser")]
    sys.modules[inner.__name__] = inner
    sys.modules.update({name: MagicMock() for name in BUTTONS})
    sys.modules["IPython"] = ModuleType("IPython")
    vars(sys.modules["IPython"]).update(version_info=(8, 24), get_ipython=lambda: None)  # as matplotlib asks
    from seeq.addons.stictionanalyser._CreatePVOP import CreatePVOP  # type: ignore[import-not-found]

    return CreatePVOP


def share(told: Any) -> float:
    """Return the share of cycles with a corner: its list holds "k / n" a stretch that oscillates, n one more."""
    pairs = [each.split(" / ") for each in told if isinstance(each, str) and " / " in each]
    return sum(int(k) for k, _ in pairs) / max(1, sum(int(n) - 1 for _, n in pairs))


def main() -> None:
    import pandas as pd

    cases, results = Path(sys.argv[1]), Path(sys.argv[2])
    create = method(Path(next(each for each in sys.path if (Path(each) / "seeq/addons/stictionanalyser").is_dir())))
    files = defaultdict(list)
    with (cases / "cases.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            files[row["set"], row["case"]].append(cases / row["file"])
    warnings.simplefilter("ignore")
    with results.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["set", "case", "method", "score", "says", "stiction_pct"])
        for (set_, case), paths in files.items():
            scores = []
            for table in (pd.read_csv(path) for path in paths if path.is_file()):
                if "pv" not in table:
                    continue
                error, output = table["sp"] - table["pv"], table["op_pct"]
                with contextlib.redirect_stdout(io.StringIO()):
                    scores.append(share(create(error, output, 0, output, error)[0]))
            if scores:
                writer.writerow([set_, case, NAME, f"{sum(scores) / len(scores):.4f}", "", ""])
                file.flush()


if __name__ == "__main__":
    main()
