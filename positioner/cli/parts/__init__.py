"""What several commands share: child processes, a simulated plant of them, a daemon's address, series from files."""
