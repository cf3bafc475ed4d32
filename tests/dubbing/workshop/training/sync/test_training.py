"""Own offsets, batches, the network's learning, and its file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dubbing.errors import SyncError
from dubbing.face.mouth.mouth_shape import CORNERS, MOUTH
from dubbing.sync.network.channels import MOUTH_CHANNELS, SOUND_CHANNELS, WIDTH, mouth_channels
from dubbing.sync.network.embeddings import mouth_windows
from dubbing.sync.network.streams import LipStream
from dubbing.sync.network.sync_network import (
    MemberInputs,
    SyncNetwork,
    TwoStream,
    load_network,
    save_network,
)
from dubbing.workshop.training.sync import clips
from dubbing.workshop.training.sync.augmentation import MIRROR, mouth_sides, vary_mouth, vary_sound
from dubbing.workshop.training.sync.batches import Batches
from dubbing.workshop.training.sync.clips import Recording, TalkingClip
from dubbing.workshop.training.sync.correlation import align
from dubbing.workshop.training.sync.evaluation import area_under_roc, embed, shifts_found
from dubbing.workshop.training.sync.speakers import TRAINING_SPEAKERS, UNSEEN
from dubbing.workshop.training.sync.training import (
    SyncTraining,
    train_network,
    train_sync,
    usable_clips,
)
from tests.dubbing.sync.made import made_clip
from tests.dubbing.sync.meshes import canonical

pytestmark = pytest.mark.medium


LATE = {"a": 0.0, "b": 0.12, "c": -0.08, "d": 0.0, "e": 0.04}
CLIPS = [made_clip(name, seed, late) for seed, (name, late) in enumerate(LATE.items())]


def test_own_offsets_are_found() -> None:
    aligned, peaks = align(CLIPS)
    shared = np.mean([c.offset - LATE[c.name] for c in aligned])
    for clip, peak in zip(aligned, peaks, strict=True):
        assert clip.offset - shared == pytest.approx(LATE[clip.name], abs=0.025)
        assert peak > 0.3
    # What all clips share cannot be known; starting from none, little is added.
    assert abs(shared) < 0.05


def test_exact_clips_set_the_zero() -> None:
    """Two clips known to be in time, among others of which all but one are late or early."""
    late = {"a": 0.12, "b": 0.12, "c": 0.08}
    clips = [made_clip(name, seed, value) for seed, (name, value) in enumerate(late.items())]
    exact = [replace(made_clip(f"exact{k}", 20 + k), exact=True) for k in range(2)]
    aligned, _ = align([*clips, *exact])
    found = {c.name: c.offset for c in aligned}
    assert found["exact0"] == found["exact1"] == 0
    for name, value in late.items():
        assert found[name] == pytest.approx(value, abs=0.025)


def test_a_clip_whose_sound_does_not_fit_is_left_out() -> None:
    stranger = made_clip("x", 99)
    wrong = made_clip("wrong", 100)
    mixed = type(wrong)("wrong", wrong.shapes, wrong.times, stranger.sound, stranger.voice)
    assert "wrong" not in [c.name for c in usable_clips([*CLIPS, mixed])]


def test_mirror_is_its_own_inverse_and_swaps_the_corners() -> None:
    assert np.array_equal(MIRROR[MIRROR], np.arange(len(MOUTH)))
    right, left = (MOUTH.index(p) for p in CORNERS)
    assert MIRROR[right] == left
    # A symmetric mouth stays where it is.
    mouth = CLIPS[0].shapes[0]
    lips = slice(0, 40)
    assert np.allclose((mouth[MIRROR] * [-1, 1])[lips], mouth[lips], atol=1e-5)


def test_sides_of_the_mouth() -> None:
    sides = mouth_sides(CLIPS)
    right, left = (sides[MOUTH.index(p)] for p in CORNERS)
    assert right < -0.7
    assert left > 0.7
    assert np.abs(sides).max() == pytest.approx(1)


def some_mouths(clip: TalkingClip, count: int) -> torch.Tensor:
    """The first windows (count, 5, S) of all that a network looks at."""
    seen = mouth_channels(clip.shapes, clip.crops, clip.times)
    return torch.from_numpy(mouth_windows(seen, clip.times, clip.times[:count]))


@pytest.mark.parametrize("sees", MOUTH_CHANNELS)
def test_batches_have_their_shapes_and_repeat(sees: str) -> None:
    one, two = (Batches(CLIPS, sees, np.random.default_rng(3)).draw() for _ in range(2))
    assert one[0].shape == (288, 5, MOUTH_CHANNELS[sees].stop - MOUTH_CHANNELS[sees].start)
    assert one[1].shape == (288, 10, WIDTH)
    assert all(torch.equal(a, b) for a, b in zip(one, two, strict=True))
    assert torch.isfinite(one[0]).all()
    assert torch.isfinite(one[1]).all()


def test_variations_keep_shapes_and_change_values() -> None:
    rng = np.random.default_rng(0)
    mouths = rng.normal(0, 0.05, (3, 5, 2 * len(MOUTH))).astype(np.float32)
    mels = rng.uniform(0, 1.5, (3, 10, WIDTH)).astype(np.float32)
    varied = vary_mouth(mouths, mouth_sides(CLIPS), rng)
    for before, after in ((mouths, varied), (mels, vary_sound(mels, rng))):
        assert after.shape == before.shape
        assert after.dtype == np.float32
        assert 0 < np.abs(after - before).mean() < 0.6


STEPS = {"lips": 30, "pixels": 120}  # of which pixels take a third
INPUTS = (MemberInputs("lips", "mel"), MemberInputs("lips", "rnn"), MemberInputs("pixels", "mel"))


@pytest.mark.parametrize("inputs", INPUTS)
def test_it_learns_and_finds_shifts_of_a_clip_it_never_saw(
    tmp_path: Path, inputs: MemberInputs
) -> None:
    used = usable_clips(CLIPS)
    network = train_network(
        used, canonical(), SyncTraining(steps=STEPS[inputs.mouth], members=(inputs,))
    )
    unseen = embed(network, made_clip("unseen", 50))
    # Positive: the sound is early. What the clips' offsets have in common stays in the network.
    assert abs(unseen.offset) <= 1
    assert np.mean(shifts_found(unseen, 3.0)) > 0.95
    late = embed(network, made_clip("late", 51, late=0.2))
    assert late.offset - unseen.offset == pytest.approx(-5, abs=1)
    # A clip that is said to be exact is counted from 0, not from what it reads.
    wrong = embed(network, replace(made_clip("late", 51, late=0.2), exact=True))
    assert np.mean(shifts_found(wrong, 3.0)) < 0.1
    path = tmp_path / "weights.safetensors"
    save_network(network, path, {"clips": []})
    mouths = some_mouths(CLIPS[0], 50)
    _, sound = Batches(CLIPS, "lips", np.random.default_rng(0)).draw()
    again = load_network(path)
    assert [member.inputs for member in again.pairs()] == [inputs]
    assert torch.allclose(network.embed_mouth(mouths), again.embed_mouth(mouths), atol=2e-2)
    assert torch.allclose(network.embed_sound(sound), again.embed_sound(sound), atol=2e-2)


def test_training_repeats_itself() -> None:
    settings = SyncTraining(steps=3, members=(MemberInputs("pixels", "rnn"),))
    one, two = (train_network(CLIPS, canonical(), settings).state_dict() for _ in range(2))
    assert all(torch.equal(one[k], two[k]) for k in one)


def test_loss_prefers_matching_pairs() -> None:
    torch.manual_seed(0)
    member = TwoStream(MemberInputs("lips", "mel")).eval()
    assert isinstance(member.mouth, LipStream)
    member.mouth.basis.normal_()
    mouth, sound = torch.randn(6, 5, 2 * len(MOUTH)), torch.rand(6, 10, WIDTH)
    v, a = member.embed_mouth(mouth), member.embed_sound(sound)
    logits = (member.sharpness.exp() * v @ a.T).detach()
    expected = 0.0
    for i in range(6):
        expected += float(torch.logsumexp(logits[i], 0) + torch.logsumexp(logits[:, i], 0))
        expected -= 2 * float(logits[i, i])
    assert member.loss(mouth, sound).item() == pytest.approx(expected / 12, rel=1e-4)


def test_embeddings_have_length_one() -> None:
    network = load_network()
    _, sound = Batches(CLIPS, "lips", np.random.default_rng(0)).draw()
    mouths = some_mouths(CLIPS[0], 50)
    for embedding in (network.embed_mouth(mouths), network.embed_sound(sound)):
        assert embedding.shape[1] == network.size
        assert torch.allclose(embedding.norm(dim=1), torch.ones(len(embedding)), atol=1e-5)


def test_a_member_hears_its_own_channels_only() -> None:
    torch.manual_seed(0)
    for hears, other in (("mel", "rnn"), ("rnn", "mel")):
        member = TwoStream(MemberInputs("lips", hears)).eval()
        sound = torch.rand(4, 10, WIDTH)
        changed = sound.clone()
        changed[..., SOUND_CHANNELS[other]] += 1
        assert torch.equal(member.embed_sound(sound), member.embed_sound(changed))
        changed[..., SOUND_CHANNELS[hears]] += torch.rand(4, 10, 1)
        assert not torch.allclose(member.embed_sound(sound), member.embed_sound(changed))


def test_the_channels_fill_the_width() -> None:
    places = [k for part in SOUND_CHANNELS.values() for k in range(part.start, part.stop)]
    assert places == list(range(WIDTH))


def test_weights_of_another_acoustic_network_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "weights.safetensors"
    save_network(SyncNetwork(INPUTS[1:2]), path, {})
    monkeypatch.setattr("dubbing.sync.network.sync_network.fingerprint", lambda _: "another")
    with pytest.raises(SyncError, match="acoustic network"):
        load_network(path)


def test_wrong_weights_is_reported(tmp_path: Path) -> None:
    with pytest.raises(SyncError, match="train-sync"):
        load_network(tmp_path / "none.safetensors")
    path = tmp_path / "text.safetensors"
    path.write_text("no weights")
    with pytest.raises(SyncError, match="cannot be read"):
        load_network(path)


def test_too_few_clips(tmp_path: Path) -> None:
    with pytest.raises(SyncError, match="too few"):
        train_sync([], tmp_path / "out.safetensors")


def test_the_unseen_speakers_are_others() -> None:
    for field in ("seed", "voice", "text"):
        learned, unseen = (
            {getattr(p, field) for p in parts} for parts in (TRAINING_SPEAKERS, UNSEEN)
        )
        assert len(unseen) == len(UNSEEN)
        assert not learned & unseen


def test_area_under_the_roc() -> None:
    assert area_under_roc([3, 2], [1, 0]) == 1
    assert area_under_roc([1, 1], [1, 1]) == 0.5
    assert area_under_roc([0, 2], [1]) == 0.5


def test_members_average_their_squared_distances() -> None:
    network = SyncNetwork(INPUTS)
    for member in network.members:
        for name, basis in member.named_buffers():
            if name.endswith("basis"):
                torch.nn.init.normal_(basis)
    network.eval()
    mouth, sound = torch.randn(4, 5, MOUTH_CHANNELS["pixels"].stop), torch.rand(4, 10, WIDTH)
    joint = (network.embed_mouth(mouth) - network.embed_sound(sound)).pow(2).sum(1)
    each = [
        (m.embed_mouth(mouth[..., MOUTH_CHANNELS[m.inputs.mouth]]) - m.embed_sound(sound))
        .pow(2)
        .sum(1)
        for m in network.pairs()
    ]
    assert torch.allclose(joint, torch.stack(each).mean(0), atol=1e-5)


def test_what_another_version_kept_of_a_clip_is_measured_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = Recording(
        Path("someone.mp4"), np.zeros((4, 478, 3)), np.arange(4.0), np.zeros(80), np.ones(2, bool)
    )
    monkeypatch.setattr(clips, "record", lambda path: measured)
    np.savez(tmp_path / "someone.npz", meshes=measured.meshes, mel=np.zeros((4, 80)))
    for _ in range(2):
        found = clips.recorded(Path("someone.mp4"), tmp_path)
        np.testing.assert_array_equal(found.times, measured.times)
        assert found.voice.all()
    monkeypatch.setattr(clips, "record", lambda path: pytest.fail("kept, but measured again"))
    clips.recorded(Path("someone.mp4"), tmp_path)
