"""Find the effect that the model lacks: where it misses the data, what explains it, how sure that is."""
