"""Mazes: walls, start and goal, and the file formats they come in (nothing of the snake's dynamics).

``load.load_maze`` reads any format into a ``maze.Maze``; ``field.DistanceField``
answers how far the nearest wall is, fast; ``placement.check_placement`` says in one
line why a start or a goal is impossible; ``draw.draw_maze`` puts it on paper.
"""
