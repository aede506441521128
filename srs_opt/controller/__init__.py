"""What a microcontroller plays: programs of gaits and plans in ticks, and their C source."""
