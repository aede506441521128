"""What joins packages: plan and drive in one call, and what commands below `planners` need of it."""
