"""Direct collocation of one gait cycle: point equations, sparse assembly, IPOPT."""
