"""What a gait can be optimized for: each objective in one place, built in or of one's own."""
