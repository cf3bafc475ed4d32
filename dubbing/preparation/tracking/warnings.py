"""Warnings about a clip, from the results of tracking."""

import numpy as np

from dubbing.face.finding.landmarks import face_width
from dubbing.media import MediaInfo
from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.tracking.detection import Arrays
from dubbing.preparation.tracking.likeness import FARTHEST
from dubbing.preparation.tracking.reach import angles_of, hidden, reach_of, views_of
from dubbing.preparation.tracking.tracking import APART, HIDDEN

SMALL_FACE = 64  # source px: the landmarks are 1.7 px off
LARGE_YAW = 35.0  # degrees


def warnings_of(
    info: MediaInfo, first: int, size: int, surveyed: Arrays, detected: Arrays, poses: Poses
) -> list[str]:
    """Sentences for the report; empty without warnings.

    Args:
        first: frame of the clip that is the first of these.
        detected: `valid` (T,) says where a pose is known, `points` (T, 478, 2 or more) lie where
            the head's pose shows them if no landmarks were found there.
    """
    out = []

    def at(frame: int | np.integer) -> str:
        return f"{(first + int(frame)) / float(info.rate or 1):.1f} s"

    valid, covered, over = detected["valid"], detected["covered"], detected["over"]
    kept, views = hidden(valid, covered), views_of(poses.rotation, poses.translation)
    seen = reach_of(views, valid, over, kept)
    if no_face := seen.reasons.get("no face"):
        out.append(
            f"no face in {no_face} of {seen.frames} frames, the first at "
            f"{at(np.flatnonzero(~valid)[0])}; they are left as filmed"
        )
    apart = detected["apart"] / (APART * size / 512)
    unlike = np.flatnonzero(valid & (apart >= HIDDEN))
    if len(unlike):
        out.append(
            f"something may cover the face in {len(unlike)} frames, the first at "
            f"{at(unlike[0])}; their poses are carried over from around them"
        )
    if behind := seen.reasons.get("covered"):
        out.append(
            f"the mouth is covered, or lit as nowhere else, in {behind} frames, the first at "
            f"{at(np.flatnonzero(kept == 2)[0])}; they are left as filmed, unless the "
            "learned head explains them, or tells what covers it"
        )
    if seen.overlaid:
        out.append(
            f"something lies over the lower face in {seen.overlaid} frames, the first at "
            f"{at(np.flatnonzero(over & (kept == 0))[0])}: captions, a microphone; it "
            "stays over the new mouth, look at these frames"
        )
    unsure = np.flatnonzero(valid & (apart > 1) & (apart < HIDDEN))
    if len(unsure):
        out.append(
            f"the landmarks are unsure in {len(unsure)} frames, the first at "
            f"{at(unsure[0])}; their poses lean on the frames around them"
        )
    dissolved = np.flatnonzero(surveyed["shown"] < 1)
    if len(dissolved):
        out.append(
            f"shots dissolve into one another in {len(dissolved)} frames, the first at "
            f"{at(dissolved[0])}; the new mouth fades with its shot"
        )
    cuts = first + np.flatnonzero(np.diff(surveyed["segment"])) + 1
    if len(cuts):
        out.append(
            f"{len(cuts)} cuts, at frames {', '.join(map(str, cuts))}; nothing is carried over them"
        )
    heights = [face_width(p) for p in detected["points"][valid]]
    height = float(np.median(heights)) * float(surveyed["window"][0, 2]) / size
    if height < SMALL_FACE:
        out.append(f"the face is only {height:.0f} px high in the source; expect a soft result")
    turned = np.flatnonzero(valid & (np.abs(angles_of(views)[0]) > LARGE_YAW))
    if len(turned):
        out.append(
            f"the head is turned {seen.turned()}, more than {LARGE_YAW:.0f} degrees in "
            f"{len(turned)} frames, the first at {at(turned[0])}; landmarks are less "
            "sure there: learn from seconds that show the head so, and look at these frames"
        )
    if info.variable_rate:
        out.append(f"variable frame rate; read at a constant {float(info.rate or 0):.3f}")
    repeated = int(surveyed["repeated"].sum())
    if repeated:
        out.append(f"{repeated} frames repeat the one before them")
    return out


def face_warnings_of(info: MediaInfo, first: int, surveyed: Arrays) -> list[str]:
    """Sentences that say whose face was taken; empty where a clip shows one face alone."""
    several = [several_faces(info, first, surveyed)] if int(surveyed["most_faces"]) > 1 else []
    return several + matched_shots(first, surveyed)


def several_faces(info: MediaInfo, first: int, surveyed: Arrays) -> str:
    """Which of several faces was followed, and how to choose another."""
    text = (
        f"up to {int(surveyed['most_faces'])} faces in a frame; the contact sheet shows the one "
        "that was followed in each shot"
    )
    if np.isnan(surveyed["other"]).any():
        return text
    frame, size = int(surveyed["other"][0]), np.array([info.width, info.height])
    followed = (surveyed["box"][frame, :2] + surveyed["box"][frame, 2:]) / 2 / size
    x, y = surveyed["other"][1:] / size
    at = (first + frame) / float(info.rate or 1)
    return (
        f"{text}: at {at:.1f} s that at x {followed[0]:.2f}, y {followed[1]:.2f}; for another set "
        f"face: {{at: {at:.2f}, x: {x:.2f}, y: {y:.2f}}}"
    )


def matched_shots(first: int, surveyed: Arrays) -> list[str]:
    """Shots in which a person was recognised by their looks, and shots without them."""
    distance, segment = surveyed["distance"], surveyed["segment"]
    begin = first + np.flatnonzero(np.diff(segment, prepend=-1))
    out = []
    sure = [f"{begin[k]} ({distance[k]:.2f})" for k in np.flatnonzero(distance > 0)]
    if sure:
        out.append(
            f"found by looks in the shots that begin at frames {', '.join(sure)}: in brackets the "
            f"distance, {FARTHEST:.2f} at most"
        )
    gone = [str(begin[k]) for k in np.flatnonzero(np.isnan(distance))]
    if gone:
        out.append(
            f"not found in the shots that begin at frames {', '.join(gone)}, "
            "which are left as filmed"
        )
    return out
