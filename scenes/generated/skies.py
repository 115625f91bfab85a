"""Skies: images by latitude (from +y down) and longitude, or one radiance for all around."""

from __future__ import annotations

import math

import numpy as np

from onespp.scenes.description import Color

ROWS, COLUMNS = 48, 96


def overcast(random: np.random.Generator, radiance: float) -> Color:
    """The same from everywhere."""
    return radiance, radiance * random.uniform(1.0, 1.1), radiance * random.uniform(1.05, 1.3)


def sun(random: np.random.Generator, radiance: float) -> np.ndarray:
    """A blue sky with a sun, one to three pixels (4 to 11 degrees) wide, half hidden or bare."""
    image = _gradient((0.18, 0.32, 0.75), (0.75, 0.8, 0.85), (0.5, 0.48, 0.45)) * radiance
    high = random.uniform(25, 62)
    wide = int(random.integers(1, 4))
    row = round((90 - high) / 180 * ROWS)
    columns = (int(random.integers(COLUMNS)) + np.arange(wide)) % COLUMNS
    # Onto the ground it sends one to three times what the sky does.
    solid = 2 * math.pi / COLUMNS * math.pi / ROWS * math.cos(math.radians(high)) * wide**2
    flux = random.uniform(1, 3) * radiance * 0.5 * math.pi / math.sin(math.radians(high))
    image[row:row + wide, columns] = flux / solid * np.array((1.0, 0.88, 0.68))
    return image


def evening(random: np.random.Generator, radiance: float) -> np.ndarray:
    """A dim sky, warm on one side."""
    image = _gradient((0.12, 0.16, 0.4), (0.6, 0.5, 0.55), (0.4, 0.33, 0.36))
    around = 2 * math.pi * np.arange(COLUMNS) / COLUMNS + random.uniform(0, 2 * math.pi)
    glow = np.maximum(np.cos(around), 0)[None, :, None] ** 4 * np.array((1.2, 0.6, 0.2))
    low = np.exp(-((np.arange(ROWS) - ROWS / 2) / 6) ** 2)[:, None, None]
    return radiance * (image + glow * low)


def irradiance(sky: Color | np.ndarray | None, normals: np.ndarray) -> np.ndarray:
    """(n, 3) light onto (n, 3) normals from the whole of a sky."""
    if sky is None:
        return np.zeros((len(normals), 3))
    if isinstance(sky, tuple):
        return np.full((len(normals), 3), math.pi) * np.asarray(sky)
    polar = math.pi * (np.arange(ROWS) + 0.5) / ROWS
    # Longitude 0, the image's left edge, is toward -z in Mitsuba, and grows toward +x.
    around = 2 * math.pi * (np.arange(COLUMNS) + 0.5) / COLUMNS
    toward = np.stack(np.broadcast_arrays(
        np.sin(polar)[:, None] * np.sin(around), np.cos(polar)[:, None],
        -np.sin(polar)[:, None] * np.cos(around)), axis=2)
    solid = np.sin(polar)[:, None] * (math.pi / ROWS) * (2 * math.pi / COLUMNS)
    cosines = np.maximum(np.einsum("rcx,nx->nrc", toward, normals), 0) * solid
    return np.einsum("nrc,rck->nk", cosines, sky)


def _gradient(zenith: Color, horizon: Color, ground: Color) -> np.ndarray:
    """(ROWS, COLUMNS, 3)."""
    up = np.cos(math.pi * (np.arange(ROWS) + 0.5) / ROWS)[:, None]
    sky = np.asarray(horizon) + (np.asarray(zenith) - np.asarray(horizon)) * np.sqrt(np.abs(up))
    rows = np.where(up > 0, sky, np.asarray(ground))
    return np.repeat(rows[:, None], COLUMNS, axis=1)
