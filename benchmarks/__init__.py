"""Figures that depend on the machine, as ratios within one run: `make bench`. Not tests."""
