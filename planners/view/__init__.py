"""Pictures of plans: maze with swept body, clearance along the way, animations."""
