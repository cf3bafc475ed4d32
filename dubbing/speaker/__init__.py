"""A synthetic speaker: a rendered head whose mouth follows phones with known times.

It stands in for footage of people in the demo and the tests, and gives clips with exact truth:
head poses, mattes, mouth opening, phone times, A/V offset.
"""

from dubbing.speaker.face import FACES, Face, random_face
from dubbing.speaker.speaker import SpeakerTruth, make_speaker
from dubbing.speaker.visemes import Phone
from dubbing.speaker.voice import speak, synthesise

__all__ = [
    "FACES",
    "Face",
    "Phone",
    "SpeakerTruth",
    "make_speaker",
    "random_face",
    "speak",
    "synthesise",
]
