"""What a cycle of a gait does to the robot: displacement, speed and swept body, transients included.

A gait is changed only where a cycle ends. The curvature follows the valves within a cycle and lateral
slip dies out at once, but the forward speed takes several cycles to settle (rolling friction is weak), so
a cycle's outcome depends on the gait before, the gait now, and the speed at its start, and on nothing else
that matters: ``transitions`` simulates that table once per gait table, ``table`` looks it up.
"""
