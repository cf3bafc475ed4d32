"""Weights of the networks that find faces, hands and people, by name; a module without torch."""

from pathlib import Path

FACE_DETECTOR = Path(__file__).with_name("face_detector.safetensors")
FACE_LANDMARKS = Path(__file__).with_name("face_landmarks.safetensors")
HAND_DETECTOR = Path(__file__).with_name("hand_detector.safetensors")
HAND_LANDMARKS = Path(__file__).with_name("hand_landmarks.safetensors")
PERSON_MASK = Path(__file__).with_name("person_mask.safetensors")
# By name: the networks that find faces, the person round a face, and hands.
FACE_WEIGHTS: dict[str, Path] = {"face_detector": FACE_DETECTOR, "face_landmarks": FACE_LANDMARKS}
PERSON_WEIGHTS: dict[str, Path] = {"person_mask": PERSON_MASK}
HAND_WEIGHTS: dict[str, Path] = {"hand_detector": HAND_DETECTOR, "hand_landmarks": HAND_LANDMARKS}
