"""The laboratory: data sets, bench tests, shape and motion from markers, Motive import."""
