"""Switch-exact simulation: steps end at valve switches, curvature in closed form."""
