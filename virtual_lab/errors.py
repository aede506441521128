"""What the laboratory says when it cannot do what was asked."""

from __future__ import annotations


class LabError(ValueError):
    """The request is at fault: an effect, a size, a place, a folder."""
