"""Where a rig imposes the position there is nothing to simulate: forces are balanced, and the rest diagnosed."""
