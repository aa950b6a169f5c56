"""What `positioner reproduce` holds against each other: the seed's scenario, its formulas as printed, its claims."""
