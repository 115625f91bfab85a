"""Hashes of clips, for processes that read them: this imports no test."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

from onespp.clips.clips import Clips


def digest(clip: dict[str, Any]) -> str:
    text = hashlib.sha256()
    for name, value in sorted(clip.items()):
        text.update(f"{name} {value.dtype} {value.shape}".encode() + value.tobytes())
    return text.hexdigest()


def digests(clips: Clips, indices: Iterable[int]) -> list[str]:
    return [digest(clips[i]) for i in indices]
