"""One page per data set: what was seen, trial by trial."""
