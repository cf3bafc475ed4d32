"""Detects frames in which something covers the lower face, by its unusual colours.

Colours are sampled at the points of the mesh, which stays in place when a hand covers the mouth,
and are compared in the light of each frame. What a turned head hides of itself is not compared. T
frames, P = 478 points.
"""

from collections.abc import Iterable

import cv2
import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.face.mesh_points import NOSE_BASE, NOSE_BRIDGE, RIGID
from dubbing.face.mesh_triangles import TRIANGLES
from dubbing.face.mouth.mouth_shape import INNER_LIP
from dubbing.preparation.alignment.skin import vertex_normals
from dubbing.preparation.covering.light import Light, Sight, coarse_gain, light_of, sampled

HALF_WIDTH = 0.42  # units of 10 cm from the middle of the face: beyond, cheeks turn away
DARK = 8.0  # added to colours (0..255) before their logarithm: noise of dark ones counts less
UNUSUAL = 3.0  # deviations of a point from its median colour
LEAST_SPREAD = 0.06  # of a logarithm: least deviation of a point
SHARE = 0.35  # of the lower face that is unusual where something covers it
AROUND = 2  # frames before and after, which may be covered in part
# Cosine between a point's normal and the view from which a frame sees it. One that the usual view
# sees from the side is seen by other frames too, unless its cosine is less by so much.
FACING, LESS = 0.3, 0.2
# A head that turns further than so much (rad) from its usual view looks different: by so much of a
# logarithm for every rad.
TURNED, SHADED = 0.2, 0.4
DARKEST = 1  # percent of a frame's pixels
OWN_FRAMES = 25  # of a shot to have its own usual colours; a shorter one takes the clip's


def covered_step(
    crops: Iterable[np.ndarray],
    points: np.ndarray,
    valid: np.ndarray,
    segment: np.ndarray,
    shape: np.ndarray,
    views: np.ndarray,
    progress: ReportShare,
) -> dict[str, np.ndarray]:
    """Frames in which the lower face is covered, or lit in a way that gain and offset cannot fit.

    Args:
        crops: (S, S, 3) RGB of all frames.
        points: (T, P, 2 or more) px of the crop. valid: (T,) bool, they are known.
        segment: (T,) number of the shot. shape: (P, 3) in the head frame.
        views: (T, 3) unit vectors from the head to the camera, in the head frame.

    Returns:
        covered (T,) bool; gain and offset (T, 3) of the light, see :class:`Light`.
    """
    colours = np.zeros((len(points), len(shape), 3), np.float32)
    level, dark = np.zeros((2, len(points), 3))
    for t, image in enumerate(crops):
        colours[t], some = sampled(image, points[t]), image[::8, ::8]
        level[t], dark[t] = some.mean((0, 1)), np.percentile(some, DARKEST, (0, 1))
        progress((t + 1) / len(points))
    share = np.zeros(len(points))
    gain, offset = np.ones((len(points), 3)), np.zeros((len(points), 3))
    for shot in np.unique(segment):
        own = valid & (segment == shot)
        reference = own if own.sum() >= OWN_FRAMES else valid
        if own.any():
            sight = sight_of(colours, dark, shape, views, views[reference])
            share[own], light = unusual_share(sight.of(own), sight.of(reference), shape)
            gain[own], offset[own] = light.gain, light.offset
            faceless = (segment == shot) & ~valid
            gain[faceless] = coarse_gain(level[faceless], np.median(level[own], 0))
    covered = (share > SHARE).astype(np.uint8)
    for shot in np.unique(segment):
        part = segment == shot
        covered[part] = cv2.dilate(covered[part][None], np.ones((1, 2 * AROUND + 1), np.uint8))[0]
    return {"covered": (covered > 0) & valid, "gain": gain, "offset": offset}


def sight_of(
    colours: np.ndarray,
    dark: np.ndarray,
    shape: np.ndarray,
    views: np.ndarray,
    reference: np.ndarray,
) -> Sight:
    """Those of colours (T, P, 3) at the points of a mesh (P, 3) that frames see.

    Args:
        dark: (T, 3) of their darkest pixels.
        views: (T, 3). reference: (U, 3), views that are mostly the usual one.
    """
    usual = reference[(reference @ np.median(reference, 0)).argmax()]
    normals = vertex_normals(shape, TRIANGLES)
    facing = views @ normals.T
    seen = (facing > FACING) | (facing > normals @ usual - LESS)
    turn = np.arccos(np.clip(views @ usual, -1, 1))
    return Sight(np.where(seen[..., None], colours, np.nan), turn, dark)


def unusual_share(sight: Sight, reference: Sight, shape: np.ndarray) -> tuple[np.ndarray, Light]:
    """Share (T,) of the lower face's points with an unusual colour, and the light of the frames.

    Args:
        reference: of frames that are mostly not covered.
        shape: (P, 3) in the head frame.
    """
    lower, upper = regions(shape)
    usual = np.nanmedian(reference.colours, 0)
    usual = np.nanmedian(light_of(reference, usual, upper).unlit(reference.colours), 0)

    def away(of: Sight, light: Light) -> np.ndarray:
        there = np.log(np.maximum(of.colours[:, lower], 0) + DARK)
        wanted = np.log(np.maximum(light.lit(usual[lower]), 0) + DARK)
        return np.asarray(np.linalg.norm(there - wanted, axis=2))

    apart = away(reference, light_of(reference, usual, upper))
    spread = np.maximum(1.4826 * np.nanmedian(apart, 0), LEAST_SPREAD)
    light = light_of(sight, usual, upper)
    shaded = SHADED * np.maximum(sight.turn - TURNED, 0)
    apart = away(sight, light)
    unusual = apart > UNUSUAL * spread + shaded[:, None]
    return np.asarray(unusual.sum(1) / np.maximum((~np.isnan(apart)).sum(1), 1)), light


def regions(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the lower face without the inner mouth, and the points that light is fitted to."""
    down = shape[:, 1]
    below = (down > down[NOSE_BASE]) & (np.abs(shape[:, 0]) < HALF_WIDTH)
    below[list(INNER_LIP)] = False
    rigid = np.zeros(len(shape), bool)
    rigid[list(RIGID)] = True
    return np.flatnonzero(below), np.flatnonzero(rigid & ~below & (down > down[NOSE_BRIDGE]))
