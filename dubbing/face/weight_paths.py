"""Networks of MediaPipe that find faces and people, by name. Nothing of it is imported."""

from pathlib import Path

from dubbing.shipped.package_files import of_package

FACES = (
    "modules/face_detection/face_detection_short_range.tflite",
    "modules/face_landmark/face_landmark_with_attention.tflite",
)
PERSON = "modules/selfie_segmentation/selfie_segmentation.tflite"
# By name: the networks that find faces, and the person round a face.
FACE_WEIGHTS: dict[str, Path] = of_package("mediapipe", *FACES)
PERSON_WEIGHTS: dict[str, Path] = of_package("mediapipe", PERSON)
