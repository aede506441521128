"""Whether an animation can be written, asked before anything slow."""

from __future__ import annotations

import shutil
from pathlib import Path

from srs_opt.errors import InputError


def check_animation_path(path: Path) -> None:
    """Refuse an animation that cannot be written."""
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise InputError(f"--animate {path}: expected a name that ends in .gif or .mp4")
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError(f"--animate {path}: ffmpeg was not found; write a .gif instead")
