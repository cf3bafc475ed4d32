"""What a manifest says of scenes: cues as frames of a film, and everything that cannot be."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

from dubbing.errors import ManifestError
from dubbing.manifest.manifest import load
from dubbing.production.dub import Dub
from dubbing.report.lines import undubbed_of
from tests import clips

pytestmark = pytest.mark.medium


SRT = """1
00:00:00,500 --> 00:00:01,000
ANN: One.

2
00:00:01,200 --> 00:00:01,600
BEN: Two.

3
00:00:02,000 --> 00:00:02,500
ANN: Three.
"""
CONSENT = '{by: "a synthetic person", reference: "form 17"}'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("scenes")
    clips.write_clip(place / "film.mp4", 75)
    clips.write_clip(place / "other.mp4", 75)
    clips.ffmpeg(
        "-i", place / "film.mp4", "-c", "copy", "-timecode", "01:00:00:00", place / "tc.mov"
    )
    clips.write_sound(place / "track.wav", 3)
    for number in (1, 3):
        clips.write_sound(place / f"{number:02d}.wav", 0.5)
    clips.write_sound(place / "long_1.wav", 0.5)
    clips.write_sound(place / "long_3.wav", 0.7)
    clips.write_sound(place / "stereo.wav", 3, channels=2)
    (place / "it.srt").write_text(SRT)
    (place / "bad.srt").write_text(SRT.replace("00:00:02,500", "00:00:09,500"))
    (place / "twice.srt").write_text(SRT.replace("BEN", "ANN").replace("01,600", "02,200"))
    (place / "hour.srt").write_text(SRT.replace("00:00:0", "01:00:0"))
    (place / "damaged.wav").write_bytes(b"no sound")
    return place


def written(folder: Path, dub: str, clip: str = "film.mp4") -> Path:
    path = folder / "m.yaml"
    path.write_text(
        "version: 1\noutput: out\nidentities:\n"
        f"  ann: {{clip: {clip}, seconds: 1, consent: {CONSENT}}}\n"
        f"  ben: {{clip: other.mp4, seconds: 1, consent: {CONSENT}}}\n"
        f"dubs:\n  - {{{dub}}}\n"
    )
    return path


def scene_of(folder: Path, dub: str, clip: str = "film.mp4") -> Dub:
    (scene,) = load(written(folder, dub, clip)).dubs.values()
    return scene


def problems(folder: Path, dub: str) -> list[str]:
    with pytest.raises(ManifestError) as caught:
        load(written(folder, dub))
    return [str(problem) for problem in caught.value.problems]


def test_one_track_beside_the_film(folder: Path) -> None:
    scene = scene_of(folder, "lines: it.srt, speakers: {ANN: ann}, audio: track.wav")
    found = [(c.identity, c.first, c.stop, c.audio_start, c.seconds) for c in scene.cues]
    # 0.5 s is frame 12.5 of 25 a second, which rounds to the even 12; the sound is of that frame.
    assert found == [("ann", 12, 25, 0.48, 0.52), ("ann", 50, 62, 2.0, 0.48)]
    assert [(c.number, c.speaker, c.words) for c in scene.cues] == [
        (1, "ANN", "One."),
        (3, "ANN", "Three."),
    ]
    assert scene.sound.left == ((30, 40),)  # Ben's
    assert scene.film.path == (folder / "film.mp4").resolve()


def test_a_line_begins_and_ends_at_the_nearest_frames(folder: Path) -> None:
    (folder / "near.srt").write_text("1\n00:00:00,510 --> 00:00:01,030\nANN: One.\n")
    (cue,) = scene_of(folder, "lines: near.srt, speakers: {ANN: ann}, audio: track.wav").cues
    assert (cue.first, cue.stop) == (13, 26)  # 12.75 and 25.75
    assert (cue.audio_start, cue.seconds) == (13 / 25, 13 / 25)


@pytest.mark.parametrize("begin", ["01,019", "01,001", "00,960"])
def test_lines_that_overlap_by_a_frame_at_most_touch(folder: Path, begin: str) -> None:
    """Times of a film's frames, rounded to thousandths by another program, may overlap."""
    text = SRT.replace("BEN", "ANN").replace("01,000", "01,020").replace("01,200", begin)
    (folder / "touch.srt").write_text(text)
    dub = "lines: touch.srt, speakers: {ANN: ann}, audio: track.wav"
    if begin == "00,960":
        assert any("lines 1 and 2 of ann overlap" in one for one in problems(folder, dub))
        return
    one, two, _ = scene_of(folder, dub).cues
    assert (one.first, one.stop, one.seconds) == (12, two.first, float((two.first - 12) / 25))


def test_speech_without_lines_has_the_nearest_frames(folder: Path) -> None:
    dub = "name: x, identity: ann, audio: track.wav, audio_start: 0.5, audio_seconds: 1.03"
    (cue,) = scene_of(folder, dub).cues
    assert (cue.first, cue.stop, cue.audio_start, cue.seconds) == (0, 26, 0.5, 1.03)


def test_a_file_a_cue_and_one_a_speaker(folder: Path) -> None:
    scene = scene_of(folder, "lines: it.srt, speakers: {ANN: ann}, audio: '{cue:02}.wav'")
    assert [(c.audio.name, c.audio_start) for c in scene.cues] == [("01.wav", 0), ("03.wav", 0)]
    scene = scene_of(folder, "lines: it.srt, speakers: {ANN: ann}, audio: {ANN: track.wav}")
    assert [c.audio.name for c in scene.cues] == ["track.wav"] * 2


def test_an_identity_alone_speaks_every_line(folder: Path) -> None:
    scene = scene_of(folder, "name: x, identity: ann, lines: it.srt, audio: track.wav")
    assert [c.number for c in scene.cues] == [1, 2, 3]
    assert not scene.sound.left


def test_the_name_of_a_scene_is_that_of_its_lines(folder: Path) -> None:
    path = written(folder, "lines: it.srt, speakers: {ANN: ann}, audio: track.wav")
    assert [*load(path).dubs] == ["it"]


def test_times_that_count_from_the_films_timecode(folder: Path) -> None:
    dub = "lines: hour.srt, speakers: {ANN: ann}, audio: track.wav"
    manifest = load(written(folder, dub, "tc.mov"))
    assert [(c.first, c.stop) for c in manifest.dubs["hour"].cues] == [(12, 25), (50, 62)]
    assert manifest.dubs["hour"].info.timecode == "01:00:00:00"
    assert any("count from 01:00:00:00" in warning for warning in manifest.warnings)


def rows(*cues: tuple[int, str, str, str]) -> str:
    return "".join(f"{n}\n{start} --> {stop}\n{words}\n\n" for n, start, stop, words in cues)


def test_a_file_a_cue_goes_by_the_printed_number(folder: Path) -> None:
    (folder / "gap.srt").write_text(SRT.replace("3\n00:00:02", "7\n00:00:02"))
    clips.write_sound(folder / "g_1.wav", 0.4)
    for number in (3, 7):
        clips.write_sound(folder / f"g_{number}.wav", 0.4)
    scene = scene_of(folder, "lines: gap.srt, speakers: {ANN: ann}, audio: 'g_{cue}.wav'")
    assert [(c.number, c.audio.name) for c in scene.cues] == [(1, "g_1.wav"), (7, "g_7.wav")]
    (folder / "gap.srt").write_text(SRT.replace("3\n00:00:02", "1\n00:00:02"))
    found = problems(folder, "lines: gap.srt, speakers: {ANN: ann}, audio: 'g_{cue}.wav'")
    assert any("lines 1 are there twice" in problem for problem in found), found


def test_every_line_that_nobody_dubs_is_listed(folder: Path) -> None:
    text = SRT.replace("BEN: Two.", "Somebody: Two.").replace("ANN: Three.", "BEN: Three.")
    (folder / "some.srt").write_text(text)
    manifest = load(written(folder, GOOD.replace("it.srt", "some.srt")))
    scene = manifest.dubs["some"]
    assert [(u.number, u.first, u.stop, u.speaker, u.words, u.why) for u in scene.undubbed] == [
        (2, 30, 40, "", "Somebody: Two.", "it names nobody"),
        (3, 50, 62, "BEN", "Three.", "BEN is not in speakers"),
    ]
    assert "some: nobody dubs 2 of 3 lines of some.srt" in manifest.warnings
    assert undubbed_of(scene)[0] == {
        "line": 2,
        "in": "00:00:01:05",
        "out": "00:00:01:15",
        "seconds": 1.2,
        "speaker": "",
        "words": "Somebody: Two.",
        "why": "it names nobody",
    }
    (folder / "some.srt").write_text(SRT.replace("BEN: Two.", "Two."))
    assert [c.number for c in scene_of(folder, GOOD.replace("it.srt", "some.srt")).cues] == [1, 3]
    (folder / "some.srt").write_text(SRT.replace("ANN: Three.", "Three."))
    manifest = load(written(folder, GOOD.replace("it.srt", "some.srt")))
    assert [u.number for u in manifest.dubs["some"].undubbed] == [2, 3]  # after BEN
    (folder / "some.srt").write_text(
        SRT.replace("BEN: Two.", "Two.").replace("ANN: Three", "BEN: 3")
    )
    manifest = load(written(folder, GOOD.replace("it.srt", "some.srt")))
    assert [c.number for c in manifest.dubs["some"].cues] == [1, 2]
    assert any("lines 2 of some.srt name nobody" in warning for warning in manifest.warnings)


def test_two_speakers_of_one_cue_need_a_track_each(folder: Path) -> None:
    cue = (2, "00:00:01,200", "00:00:01,600", "- ANN: Two.\n- BEN: Yes.")
    (folder / "two.srt").write_text(rows((1, "00:00:00,500", "00:00:01,000", "ANN: One."), cue))
    scene = scene_of(folder, GOOD.replace("it.srt", "two.srt"))
    assert [c.words for c in scene.cues] == ["One."]
    assert [(u.speaker, u.words) for u in scene.undubbed] == [("ANN", "Two."), ("BEN", "Yes.")]
    assert "give each a cue or a track" in scene.undubbed[0].why
    tracks = "lines: two.srt, speakers: {ANN: ann}, audio: {ANN: track.wav}"
    scene = scene_of(folder, tracks)
    assert [(c.words, c.first, c.stop) for c in scene.cues] == [("One.", 12, 25), ("Two.", 30, 40)]
    assert [(u.speaker, u.first, u.stop) for u in scene.undubbed] == [("BEN", 30, 40)]
    # One person under two names says both.
    (folder / "two.srt").write_text(rows((*cue[:3], "ANN: Two.\nANNA: Yes.")))
    scene = scene_of(folder, "lines: two.srt, speakers: {ANN: ann, ANNA: ann}, audio: track.wav")
    assert [c.words for c in scene.cues] == ["Two. Yes."]


def test_the_lines_of_a_reel_are_dealt_to_its_shots(folder: Path) -> None:
    reel = rows(
        (1, "01:00:01,000", "01:00:02,000", "ANN: Of another shot."),
        (2, "01:00:09,500", "01:00:10,500", "ANN: Over the cut."),
        (3, "01:00:10,500", "01:00:11,000", "ANN: Mine."),
        (4, "01:00:12,200", "01:00:12,600", "BEN: Of nobody."),
        (5, "01:00:20,000", "01:00:21,000", "ANN: Of a third."),
    )
    (folder / "reel.srt").write_text(reel)
    timecode = ["-c", "copy", "-timecode", "01:00:10:00"]
    clips.ffmpeg("-i", folder / "film.mp4", *timecode, folder / "shot.mov")
    dub = GOOD.replace("it.srt", "reel.srt")
    (folder / "reel.csv").write_text(
        "in,out,speaker,words\n01:00:01:00,01:00:02:00,ANN,a\n01:00:10:12,01:00:11:00,ANN,b\n"
    )
    for key, film in (("", "shot.mov"), (", reel_start: 1:00:10", "film.mp4")):
        manifest = load(written(folder, dub + key, film))
        scene = manifest.dubs["reel"]
        assert [(c.number, c.first, c.stop) for c in scene.cues] == [(3, 12, 25)]
        assert [(u.number, u.first, u.stop) for u in scene.undubbed] == [(2, 0, 12), (4, 55, 65)]
        assert scene.undubbed[0].why == "it reaches beyond the film"
        assert any("2 of 5 lines of reel.srt are of other shots" in w for w in manifest.warnings)
        table = scene_of(folder, dub.replace(".srt", ".csv") + key, film)
        assert [(c.number, c.first, c.stop) for c in table.cues] == [(2, 12, 25)]
    for start in ("3610", "3610.0", "'01:00:10:00'", "'1:00:10'"):
        assert scene_of(folder, f"{dub}, reel_start: {start}").cues == scene.cues
    for start, message in (
        ("7:00:00", "no line of reel.srt lies in the film, which is 7:00:00.000 to 7:00:03.000"),
        ("-1", "is no time"),
        (".nan", "is no time"),
        ("soon", "is no time"),
        ("true", "must be a time"),
    ):
        found = problems(folder, f"{dub}, reel_start: {start}")
        assert any(message in problem for problem in found), found
    assert any("reel_start" in problem for problem in problems(folder, dub))


@pytest.mark.parametrize("start", ["01:10:00;00", "01;10;00;00", "01:10:01;30"])
def test_a_reel_may_start_at_a_drop_frame_timecode(folder: Path, start: str) -> None:
    clips.write_clip(folder / "tv.mp4", 90, Fraction(30000, 1001))
    (folder / "tv.csv").write_text("in,out,speaker,words\n01:10:00;15,01:10:01;15,ANN,a\n")
    dub = f"lines: tv.csv, speakers: {{ANN: ann}}, audio: track.wav, reel_start: '{start}'"
    manifest = written(folder, dub, "tv.mp4")
    if start.endswith("30"):
        with pytest.raises(ManifestError, match="has frame 30, but there are 30 a second"):
            load(manifest)
        return
    (cue,) = load(manifest).dubs["tv"].cues
    assert (cue.first, cue.stop) == (15, 45)


@pytest.mark.parametrize(("sign", "first"), [(";", 602), (":", 710)])
def test_timecodes_that_count_otherwise_than_the_films_are_warned_of(
    folder: Path, sign: str, first: int
) -> None:
    """An hour into the day they are 108 frames late."""
    clips.write_clip(folder / "hour.mp4", 900, Fraction(30000, 1001))
    timecode = ["-c", "copy", "-timecode", "01:00:00;00"]
    clips.ffmpeg("-i", folder / "hour.mp4", *timecode, "-y", folder / "hour.mov")
    row = f"01:00:20{sign}02,01:00:21{sign}00,ANN,a\n"
    (folder / "hour.csv").write_text(f"in,out,speaker,words\n{row}")
    clips.write_sound(folder / "minute.wav", 30)
    dub = "lines: hour.csv, speakers: {ANN: ann}, audio: minute.wav"
    manifest = load(written(folder, dub, "hour.mov"))
    warned = [one for one in manifest.warnings if "its film drops frames" in one]
    assert bool(warned) == (sign == ":")
    assert manifest.dubs["hour"].cues[0].first == first


def test_one_sound_is_one_cue(folder: Path) -> None:
    scene = scene_of(folder, "identity: ann, audio: track.wav, audio_start: 1, audio_seconds: 1.5")
    (cue,) = scene.cues
    assert (cue.first, cue.stop, cue.audio_start, cue.seconds) == (0, 38, 1.0, 1.5)
    assert Fraction(cue.stop, 25) - Fraction(3, 2) < Fraction(1, 25)


GOOD = "lines: it.srt, speakers: {ANN: ann}, audio: track.wav"


@pytest.mark.parametrize(
    ("dub", "message"),
    [
        (GOOD.replace("it.srt", "bad.srt"), "line 3 of bad.srt is at 2 to 9.5 s: the film is 3.00"),
        (GOOD.replace("it.srt", "twice.srt"), "lines 2 and 3 of ann overlap"),
        (GOOD.replace("it.srt", "no.srt"), "no such file"),
        (GOOD.replace("it.srt", "track.wav"), "no kind of script"),
        (GOOD.replace("ANN", "ANNE"), "does not speak in it.srt; there is ANN, BEN"),
        (GOOD.replace("ANN: ann", "ANN: nobody"), "no identity 'nobody'"),
        (
            GOOD.replace("ANN: ann", "ANN: ann, BEN: ben"),
            "ann and ben: several people in a film need `face`",
        ),
        (GOOD.replace("track.wav", "{BEN: track.wav}"), "has no sound of 'ANN'"),
        (GOOD.replace("track.wav", "01.wav"), "lines 3 (at 2.00 s) begin after the end"),
        (GOOD.replace("track.wav", "'x{cue}.wav'"), "no such file"),
        (GOOD.replace("track.wav", "'long_{cue}.wav'"), "lines 3 (0.70 s in 0.48 s) last longer"),
        (GOOD + ", clip: other.mp4", "is no clip of ann"),
        (GOOD + ", identity: ann", "either who speaks all lines"),
        (GOOD + ", video_start: 1", "no meaning beside lines"),
        (GOOD + ", on_longer_audio: loop", "as long as its film"),
        (GOOD + ", frame: crop", "its whole film"),
        (GOOD + ", audio_rate: source", "mixed at 48000"),
        (GOOD + ", music_effects: no.wav", "no such file"),
        (GOOD + ", loudness: loud", "must be one of 'r128', 'streaming' or 'none'"),
        ("identity: ann, audio: track.wav, music_effects: track.wav", "needs lines"),
        ("identity: ann, audio: track.wav, loudness: r128", "needs lines"),
        ("identity: ann, audio: {ANN: track.wav}, name: x", "several sounds need lines"),
        ("name: x, audio: track.wav", "identity: is required"),
    ],
)
def test_what_cannot_be_is_reported(folder: Path, dub: str, message: str) -> None:
    found = problems(folder, dub)
    assert any(message in problem for problem in found), found


@pytest.mark.parametrize(("seconds", "lacks"), [(2.1, "3 (by 0.38 s)"), (2.4, "")])
def test_a_track_that_ends_within_a_line_is_said(folder: Path, seconds: float, lacks: str) -> None:
    clips.write_sound(folder / "short.wav", seconds)
    found = load(written(folder, GOOD.replace("track.wav", "short.wav"))).warnings
    said = [warning for warning in found if "longer than the track" in warning]
    assert len(said) == bool(lacks)
    assert not lacks or f"lines {lacks} last longer" in said[0]


def test_longer_recordings_can_be_cut(folder: Path) -> None:
    dub = GOOD.replace("track.wav", "'long_{cue}.wav'") + ", on_longer_audio: cut"
    assert [c.seconds for c in scene_of(folder, dub).cues] == [0.52, 0.48]


def test_a_damaged_recording_fails_its_scene_alone(folder: Path) -> None:
    manifest = load(written(folder, GOOD.replace("track.wav", "damaged.wav")))
    assert not manifest.dubs["it"].cues
    assert "not a readable media file" in str(manifest.dubs["it"].blocked)


def test_two_people_of_one_film(folder: Path) -> None:
    path = written(folder, GOOD.replace("ANN: ann", "ANN: ann, BEN: ben"))
    text = path.read_text().replace("clip: other.mp4", "clip: film.mp4")
    text = text.replace("clip: film.mp4,", "clip: film.mp4, face: {at: 0.5, x: 0.3, y: 0.5},")
    path.write_text(text)
    manifest = load(path)
    assert [c.identity for c in manifest.dubs["it"].cues] == ["ann", "ben", "ann"]
    assert [x for _, x, _ in manifest.people["ben"].clip.portraits[0].points] == [0.3]
    path.write_text(text.replace("at: 0.5", "at: 3.5"))
    with pytest.raises(ManifestError, match=r"face\.at: 3.5 s is past the end: the clip is 3.0"):
        load(path)
    path.write_text(text.replace("x: 0.3", "x: 30"))
    with pytest.raises(ManifestError, match=r"identities.ann.face.x: .*less than or equal to 1"):
        load(path)


def test_a_person_is_pointed_at_in_any_clip_of_theirs(folder: Path) -> None:
    """As in a light in which looks tell nothing; the other clips follow by looks as before."""
    path = written(folder, GOOD.replace("it.srt", "it.srt, clip: tc.mov"))
    point = "face: {at: 0.5, x: 0.3, y: 0.5, clip: tc.mov}"
    clips_of = "clips: [film.mp4, tc.mov, other.mp4], seconds: 2"
    text = path.read_text().replace("clip: film.mp4, seconds: 1", f"{clips_of}, {point}", 1)
    path.write_text(text)
    shown = {one.path.name: one.portraits for one in load(path).people["ann"].clips}
    (seen,) = shown["tc.mov"]
    assert (seen.clip.name, seen.points) == ("tc.mov", ((0.5, 0.3, 0.5),))
    assert shown["film.mp4"] == ()  # learned from: their largest face
    assert [(one.clip.name, one.points) for one in shown["other.mp4"]][:1] == [("film.mp4", ())]
    path.write_text(text.replace(", clip: tc.mov}", "}"))
    assert {
        (one.portraits[0].clip.name, len(one.portraits[0].points))
        for one in load(path).people["ann"].clips
    } == {("film.mp4", 1)}
    for change, message in (
        (("clip: tc.mov}", "clip: no.mov}"), r"ann\.face\.clip: .*no.mov is no clip of ann"),
        (("at: 0.5", "at: 9.5"), r"face\.at: 9.5 s is past the end: the clip is"),
    ):
        path.write_text(text.replace(*change))
        with pytest.raises(ManifestError, match=message):
            load(path)


def test_an_identity_of_several_clips(folder: Path) -> None:
    several = written(folder, GOOD.replace("it.srt", "it.srt, clip: tc.mov"))
    text = several.read_text().replace("clip: film.mp4, seconds: 1", "clips: [film.mp4, tc.mov]")
    several.write_text(
        text.replace("clips: [film.mp4, tc.mov],", "clips: [film.mp4, tc.mov], seconds: 2,")
    )
    manifest = load(several)
    ann = manifest.people["ann"]
    assert [clip.path.name for clip in ann.clips] == ["film.mp4", "tc.mov"]
    assert ann.clip.path.name == "film.mp4"  # the first that has two seconds
    assert manifest.dubs["it"].film.path.name == "tc.mov"
    for change, message in (
        (("clip: tc.mov", "label: true"), "dubs[0].clip: is required: ann has 2 clips"),
        (("clip: tc.mov", "clip: other.mp4"), "is no clip of ann"),
        (("tc.mov]", "no.mp4]"), "identities.ann.clips[1]: no such file"),
        (("tc.mov]", "'a.####.png']"), "a.####.png; an image sequence is EXR, DPX or TIFF"),
        (("clips: [film.mp4, tc.mov]", "clips: []"), "identities.ann.clips"),
        (("clips: [", "clip: film.mp4, clips: ["), "give either clip or clips"),
    ):
        several.write_text(several.read_text().replace(*change))
        with pytest.raises(ManifestError, match=re.escape(message)):
            load(several)
        several.write_text(several.read_text().replace(change[1], change[0]))


def test_the_clip_that_has_enough_is_learned_from(folder: Path) -> None:
    clips.write_clip(folder / "brief.mp4", 30)
    path = written(folder, GOOD + ", clip: film.mp4")
    path.write_text(
        path.read_text().replace(
            "clip: film.mp4, seconds: 1", "clips: [brief.mp4, silent.mp4, film.mp4], seconds: 2", 1
        )
    )
    clips.write_video(folder / "silent.mp4", 75)
    learned = load(path).people["ann"].learned
    assert [clip.path.name for clip in learned] == ["film.mp4"]
    # Where none has enough, all that have sound are learned from, the longest first.
    path.write_text(path.read_text().replace("seconds: 2", "seconds: 9"))
    manifest = load(path)
    learned = manifest.people["ann"].learned
    assert [clip.path.name for clip in learned] == ["film.mp4", "brief.mp4"]
    assert any("all there is, instead of 9 s" in warning for warning in manifest.warnings)


def test_what_would_look_wrong_is_refused(folder: Path) -> None:
    change = "format=yuv420p10le,setparams=color_trc=smpte2084:color_primaries=bt2020"
    options = ["-c:a", "copy", "-c:v", "libx264"]
    clips.ffmpeg("-i", folder / "film.mp4", "-vf", change, *options, folder / "hdr.mp4")
    fields = ["-vf", "interlace", "-flags", "+ilme+ildct", "-x264-params", "tff=1", *options]
    clips.ffmpeg("-i", folder / "film.mp4", *fields, folder / "fields.mp4")
    for clip, message in (("hdr.mp4", "too few for Rec.2100-PQ"), ("fields.mp4", "is interlaced")):
        with pytest.raises(ManifestError, match=re.escape(message)):
            load(written(folder, GOOD, clip))
    deep = ["-vf", "format=yuv420p10le,setsar=4/3", *options]
    clips.ffmpeg("-i", folder / "film.mp4", *deep, folder / "deep.mp4")
    manifest = load(written(folder, GOOD, "deep.mp4"))
    assert any("has 10 bits a colour" in warning for warning in manifest.warnings)
    assert any("are not square" in warning for warning in manifest.warnings)
