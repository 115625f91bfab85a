"""Writes the test scenes of Mitsuba's and glTF's kinds: python -m tests.support.scene_files DIR."""

from __future__ import annotations

import sys
from pathlib import Path

from . import gltf_scenes, xml_scenes

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for write in (*xml_scenes.SCENES.values(), *gltf_scenes.SCENES.values()):
        write(folder)
