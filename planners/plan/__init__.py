"""A plan and what belongs to it: certificate, explanation of failure, record; and the command ``plan``."""
