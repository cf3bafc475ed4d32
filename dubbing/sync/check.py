"""The sync check: offset between the sound and the mouth of a video, and how well they fit."""

from dataclasses import replace
from pathlib import Path

from dubbing import media
from dubbing.engine.disk.pieces import Pieces
from dubbing.engine.graph.stage import ReportShare
from dubbing.sync.curves import estimate
from dubbing.sync.judgement import Measurement, conclude, film_face, judge_part
from dubbing.sync.measure import measure
from dubbing.sync.network.sync_network import load_network
from dubbing.sync.result import FaceResult, Media, Segment, SyncResult
from dubbing.sync.sums import FaceSum, Parts, Sums, evidence
from dubbing.sync.voices_lag import voices_lag

METHOD = "lip geometry and mouth pixels against log-mel and speech features, two streams"
# A segment or a face needs this many compared frames to have an offset of its own.
MIN_ROWS = 40


def _segments(sums: Sums, speaker: FaceSum, source: SyncResult | None) -> list[Segment]:
    """Results of the parts: for the speaker, or in requested parts for the face that speaks."""
    segments = []
    for k, (first, stop) in enumerate(sums.parts):
        faces = sums.faces.values() if sums.apart else ()
        face = max(faces, key=lambda f: evidence(f.parts[k]), default=speaker)
        part = face.parts[k]
        best = estimate(part.curve()) if part.rows >= MIN_ROWS else None
        voice = float(sums.voice[k] / (stop - first))
        film = film_face(source, METHOD, face.centre)
        near = sums.near(face, sums.part_of == k, part, film) if best else None
        length = (stop - first) / sums.rate
        segments.append(
            Segment(
                float(first / sums.rate),
                float(stop / sums.rate),
                best.offset if best else None,
                best.confidence if best else None,
                best.distance if best else None,
                voice,
                *judge_part(best, sums.rate, length, voice, film, near),
                near.number if near else None,
                near.parts if near else {},
            )
        )
    return segments


def _faces(sums: Sums) -> list[FaceResult]:
    results = []
    speaking = sums.speaking()
    for place, (track, face) in enumerate(sums.faces.items()):
        best = estimate(face.whole.curve()) if face.whole.rows >= MIN_ROWS else None
        own = speaking == place
        results.append(
            FaceResult(
                track,
                *face.centre,
                face.frames / sums.rate,
                best.offset if best else None,
                best.confidence if best else None,
                sums.figures(face, own, face.whole, best.offset) if best else None,
            )
        )
    return sorted(results, key=lambda face: -evidence(sums.faces[face.track].whole))


def check(
    video: Path,
    *,
    source: SyncResult | None = None,
    sound_from: Path | None = None,
    voices: Path | None = None,
    parts: Parts | None = None,
    leave_out: int = 0,
    progress: ReportShare | None = None,
    pieces: Pieces | None = None,
) -> SyncResult:
    """Lip sync of a video, of any length, size, rate and number of faces.

    Frames are those of the video: at 60 fps the search covers 15 frames = 250 ms to each side.

    Args:
        video: with picture and sound.
        source: result of the clip that the video was made from, to compare with.
        sound_from: another file to take the sound from, starting together with the video.
        voices: the voices in the video's sound, by themselves. They are listened to, at the moment
            at which they are heard in the video.
        parts: the only frames (first, stop) to check; they become the segments, unless they are
            the whole video.
        leave_out: frames at the end whose picture and sound are ignored.
        progress: called with the share done, 0..1.
        pieces: folders where what is seen and heard is kept, for frames and sound that stay.

    Raises:
        MediaError: the file is missing, unreadable or has no picture.
    """
    info = media.probe(video)
    info = replace(info, frames=info.frames - leave_out)
    if parts is not None and [*parts] == [(0, info.frames)]:
        parts = None
    lag = None
    if voices is not None:
        first = parts[0][0] if parts else 0
        lag, sound_from = voices_lag(video, voices, first / float(info.rate)), voices
    sound = info if sound_from is None else media.probe(sound_from)
    if sound.audio_rate is None:
        facts = Media(info.frames, str(info.rate), info.duration, 0.0, 0.0, 0.0)
        return SyncResult("unjudged", "no sound in it", METHOD, facts, source=source)
    network = load_network()
    sums = Sums(network, info, parts)
    for block in measure(
        video,
        network.face.numpy(),
        sound_from=sound_from,
        leave_out=leave_out,
        span=None if parts is None else (min(a for a, _ in parts), max(b for _, b in parts)),
        progress=progress,
        pieces=pieces,
    ):
        sums.add(block, lag or 0.0)
    speaker = max(sums.faces.values(), key=lambda f: evidence(f.whole), default=None)
    heard = info.frames / sums.rate if leave_out else sound.sound_seconds
    facts = Media(
        frames=info.frames,
        rate=str(info.rate),
        picture_seconds=min(info.duration, sum(b - a for a, b in sums.parts) / sums.rate),
        sound_seconds=min(sound.sound_seconds, heard),
        speech_seconds=float(sums.voice.sum() / sums.rate),
        mouth_seconds=speaker.whole.rows / sums.rate if speaker else 0.0,
    )
    best = estimate(speaker.whole.curve()) if speaker else None
    measured = None
    if speaker is not None and best is not None:
        faces = _faces(sums)
        film = film_face(source, METHOD, speaker.centre)
        measured = Measurement(
            best,
            speaker.whole.curve().tolist(),
            sums.rate,
            faces[0].track,
            faces[0].figures,
            film,
            sums.near(speaker, sums.part_of >= 0, speaker.whole, film),
            _segments(sums, speaker, source),
            faces,
        )
    result = conclude(measured, METHOD, facts, source, tracked=bool(sums.faces))
    if voices is not None and lag is None and result.verdict != "unjudged":
        return replace(result, verdict="fail", reason="The voices are not heard in the video.")
    return result
