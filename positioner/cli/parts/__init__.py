"""What several commands share: child processes, the place of a daemon, series from files, pictures, virtual time."""
