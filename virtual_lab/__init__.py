"""A virtual laboratory: measured data sets from a seed, with effects hidden in them.

It stands in for a robot, a floor and a camera in tests, benchmarks and
teaching, and shares no code with the models under test:

- Kane's equations with the tail's pose as the coordinates and the partial
  velocity of every link, in place of equations summed over the chain;
- an arc and its two half gaps as one chord along the bisector of the two links;
- the explicit Runge-Kutta method of order 4 with small fixed steps that land on
  every valve switch;
- friction smoothed over 0.3 mm/s, finer than any model under test.

Nothing in ``srs_opt`` or ``planners`` imports it, and it imports neither.
"""
