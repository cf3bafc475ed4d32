"""A synthetic speaker: a rendered head whose mouth follows phones with known times.

It stands in for footage of people in the demo and the tests, and gives clips with exact truth:
head poses, mattes, mouth opening, phone times, A/V offset.
"""

from dubbing.synthetic.anatomy.face import FACES, Face, random_face
from dubbing.synthetic.speaker import SpeakerTruth, make_speaker
from dubbing.synthetic.visemes import Phone
from dubbing.synthetic.voice import speak, synthesise

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
