"""Builds sdist and wheel and tries them as a site would: `make release-check`. Minutes; prints a line a check.

The wheel is built from the sdist. Each Python that is found, 3.11 to 3.14, installs it outside the tree: into a folder
with spaces, without HOME, and, where this is root and the Python is not root's own, as somebody else. There run: the
version, the help, the register map, the estimation of a recording; with the extra `sim` a simulation and a comparison;
and the same without the modules that only Linux has.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
NOBODY = 65534
RECORDING = "time_s,command_pa,position_m\n" + "".join(f"{0.01 * i:.2f},{1e3 * (i % 50)},0.0\n" for i in range(200))
PRESSURE = "time_s,command_pa\n" + "".join(f"{0.01 * i:.2f},{min(500.0 * i, 6e4)}\n" for i in range(400))
WITHOUT_LINUX = """
import sys
sys.path.insert(0, sys.argv.pop(1))
from pretended import as_windows
as_windows()
from positioner.cli.main import main
sys.exit(main())
"""


def main() -> int:
    """Print what was checked; exit status 1 where something does not hold, 2 where nothing could be checked."""
    with tempfile.TemporaryDirectory(prefix="release check ", ignore_cleanup_errors=True) as folder:
        room = Path(folder)
        room.chmod(0o755)
        wheel = built(room)
        found = {version: path for version in PYTHONS if (path := interpreter(version))}
        missing = [version for version in PYTHONS if version not in found]
        failed = sum(not tried(room / f"a site, {version}", path, wheel) for version, path in found.items())
        print(f"{len(found)} Pythons, {failed} failed; not on this machine: {', '.join(missing) or 'none'}")
    return 2 if not found else int(failed > 0)


def built(room: Path) -> Path:
    """Return the wheel, built from the sdist."""
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(room)]
    tools = room / "tools"
    subprocess.run([sys.executable, "-m", "venv", str(tools)], check=True)
    subprocess.run([tools / "bin" / "python", "-m", "pip", "install", "--quiet", "hatchling>=1.25,<2"], check=True)
    subprocess.run(
        [tools / "bin" / "python", "-m", "hatchling", "build", "-t", "sdist", "-d", room], cwd=ROOT, check=True
    )
    (sdist,) = room.glob("*.tar.gz")
    subprocess.run([*build, str(sdist)], check=True)
    (wheel,) = room.glob("*.whl")
    print(f"built {sdist.name} and, of it, {wheel.name}", flush=True)
    return wheel


def interpreter(version: str) -> Path | None:
    """Return a Python of a version, or None."""
    kept = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
    name = shutil.which(f"python{version}", path=os.pathsep.join(("/usr/bin", "/usr/local/bin", os.defpath)))
    return Path(name) if name else next(iter(kept), None)


def tried(site: Path, python: Path, wheel: Path) -> bool:
    """Return whether everything holds on a site with this Python."""
    site.mkdir()
    others = os.geteuid() == 0 and not python.resolve().is_relative_to(Path.home())
    who = {"user": NOBODY, "group": NOBODY, "extra_groups": []} if others else {}
    if others:
        os.chown(site, NOBODY, NOBODY)
    kept = {name: value for name, value in os.environ.items() if name.startswith("PIP_") or name == "PATH"}
    environment = {**kept, "PIP_NO_CACHE_DIR": "1", "TMPDIR": str(site), "XDG_CACHE_HOME": str(site / "cache")}
    for name, text in (("rec.csv", RECORDING), ("pressure.csv", PRESSURE)):
        (site / name).write_text(text, encoding="utf-8")
    shutil.copy(ROOT / "tests" / "cli" / "pretended.py", site)
    venv = site / "its venv" / "bin"
    run = [venv / "python", "-m", "positioner.cli"]
    apart = [venv / "python", "-c", WITHOUT_LINUX, str(site)]
    simulation = ["simulate", "seed", "--input", "pressure.csv", "-o"]
    checks: list[tuple[str, list[str | Path], tuple[int, ...]]] = [
        ("venv", [python, "-m", "venv", venv.parent], (0,)),
        ("install the daemon alone", [venv / "python", "-m", "pip", "install", "--quiet", wheel], (0,)),
        ("version", [*run, "--version"], (0,)),
        ("help, which names the extras", [*run, "--help"], (0,)),
        ("map", [*run, "map", "--format", "csv"], (0,)),
        ("estimate", [*run, "estimate", "rec.csv"], (0, 1)),
        ("install [sim,plot]", [venv / "python", "-m", "pip", "install", "--quiet", f"{wheel}[sim,plot]"], (0,)),
        ("simulate", [*run, *simulation, "out.csv"], (0,)),
        ("compare", [*run, "compare", "out.csv", "--valve", "seed"], (0, 1)),
        ("simulate without Linux's own modules", [*apart, *simulation, "apart.csv"], (0,)),
        ("run without Linux's own modules is refused", [*apart, "run", "none.toml"], (2,)),
    ]
    for what, words, statuses in checks:
        done = subprocess.run(words, cwd=site, env=environment, capture_output=True, text=True, check=False, **who)  # type: ignore[call-overload]
        if done.returncode not in statuses or "Traceback" in done.stderr:
            print(f"{python}: {what}: status {done.returncode}\n{done.stdout[-500:]}{done.stderr[-2000:]}", flush=True)
            return False
    print(f"{python}: {len(checks)} hold{', as somebody else' if others else ''}", flush=True)
    return True


if __name__ == "__main__":
    sys.exit(main())
