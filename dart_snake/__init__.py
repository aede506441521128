"""The snake as bodies, joints, wheels and walls of a general physics engine (DART).

It shares no equation with ``srs_opt.model`` and imports neither ``srs_opt`` nor ``virtual_lab``: the judge of
the one and an engine of the other are built on it. The engine (package ``dartpy``) is imported when a snake
is built.
"""
