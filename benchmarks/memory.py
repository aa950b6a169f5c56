"""Whether the daemon's memory stays flat: a slave and a daemon as processes, polled and recorded, for minutes."""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from positioner.cli.parts.children import port_in, running
from positioner.dcs import Dcs

SLAVE = "[sensor]\nnoise_std_m = 1e-5\n"
DAEMON = """[valve]
stroke_m = 0.1016
[device]
port = {port}
[supervisory]
port = 0
[law]
b_over_c_pa_per_m = -814542.6
k_over_c_pa = -22068.2
[recorder]
folder = "recordings"
file_bytes = 5000000
keep_files = 3
"""


def report(minutes: float) -> list[str]:
    """Return lines: resident memory over time, and the growth of its second half."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "slave.toml").write_text(SLAVE)
        with running("sim", folder / "slave.toml", "--port", "0") as slave:
            (folder / "daemon.toml").write_text(DAEMON.format(port=port_in(slave)))
            with running("run", folder / "daemon.toml") as daemon:
                return watch(port_in(daemon), minutes, folder)


def watch(port: int, minutes: float, folder: Path) -> list[str]:
    """Poll and move the valve, and look at the daemon's memory twenty times."""
    pid = int(subprocess.run(["pgrep", "-f", f"run {folder}"], capture_output=True, text=True, check=True).stdout)
    seen: list[int] = []
    lines = []
    with Dcs("127.0.0.1", port) as dcs:
        dcs.set("mode", 2)
        for look in range(20):
            end_s = time.monotonic() + 3.0 * minutes
            while time.monotonic() < end_s:
                dcs.set("reference", 0.4 + 0.3 * (look % 2))
                dcs.get_all("position", "progress", "cycles", "float_test")
                time.sleep(0.05)
            seen.append(resident_kb(pid))
            lines.append(f"{(look + 1) * 0.05 * minutes:6.1f} min {seen[-1]:8d} kB")
    growth = seen[-1] - seen[len(seen) // 2]
    return [*lines, f"second half: {growth:+d} kB; recordings {sum(f.stat().st_size for f in folder.rglob('*.csv'))} B"]


def resident_kb(pid: int) -> int:
    """Return the resident memory of a process."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    print("\n".join(report(parser.parse_args().minutes)))
    sys.exit(0)
