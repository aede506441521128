"""OMPL's own benchmark over every planner, on the planning problem itself."""
