"""Files of a slave and of a daemon that commands it, for tests that run both as processes."""

from pathlib import Path

LAW = "[law]\nb_over_c_pa_per_m = -814542.6\nk_over_c_pa = -22068.2\n"
PATIENT = "reply_timeout_s = 2.0\n"
"""Where the device's promptness is no matter, so that a busy machine is none."""


def slave_file(folder: Path, port: int = 5020) -> Path:
    path = folder / "slave.toml"
    path.write_text(
        f"[bus]\nport = {port}\n[sensor]\nnoise_std_m = 1e-5\n[initial]\nposition_m = 0.03\npressure_pa = 24000.0\n"
    )
    return path


def daemon_file(folder: Path, device_port: int, more: str = "", device: str = "", period_s: float = 2e-3) -> Path:
    path = folder / "daemon.toml"
    path.write_text(
        "[valve]\nname = 'FV-101'\nstroke_m = 0.1016\n"
        f"[device]\nport = {device_port}\n{device}[cycle]\nperiod_s = {period_s}\n[supervisory]\nport = 0\n{LAW}{more}"
    )
    return path
