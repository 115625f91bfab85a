"""Where the repository and the data beside it lie."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
GAMES202 = ROOT.parent / "shared/data/games202-box"
