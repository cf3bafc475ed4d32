"""Speech with known phone times, from the espeak-ng library in the espeakng-loader package."""

import ctypes
import shutil
import tempfile
from pathlib import Path

import espeakng_loader
import numpy as np

from dubbing.engine.disk.files import atomic_path
from dubbing.errors import ExplainedError
from dubbing.workshop.synthetic.visemes import Phone

# From speak_lib.h of espeak-ng.
_OUTPUT_SYNCHRONOUS = 2
_PHONEME_EVENTS_IPA = 0x3
_EVENT_PHONEME = 7
_CHARS_UTF8 = 1
_POSITION_CHARACTER = 1
_PARAMETER_RATE, _PARAMETER_PITCH = 1, 3


class _Id(ctypes.Union):
    _fields_ = (("number", ctypes.c_int), ("name", ctypes.c_char_p), ("string", ctypes.c_char * 8))


class _Event(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_int),
        ("unique_identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("id", _Id),
    )


_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.POINTER(_Event)
)


def synthesise(
    text: str, voice: str = "en-us", *, words_per_minute: int = 160, pitch: int = 50
) -> tuple[np.ndarray, int, list[Phone]]:
    """Speaks a text: (samples float32 mono in -1..1, samples a second, phones in order).

    `voice` is an espeak-ng voice with an optional variant, such as "it+f3". The phones cover the
    sound from 0 to its end without gaps. The same call gives the same samples.
    Raises `ExplainedError` for an unknown voice or a text without sound.
    """
    library, folder = _fresh_library()
    try:
        rate = library.espeak_Initialize(
            _OUTPUT_SYNCHRONOUS,
            0,
            str(espeakng_loader.get_data_path()).encode(),
            _PHONEME_EVENTS_IPA,
        )
        if rate <= 0:
            raise ExplainedError("espeak-ng did not start", remedy="reinstall espeakng-loader")
        # Starting seeds the random numbers, from which breath is made, by the clock.
        library.espeak_ng_SetRandSeed(ctypes.c_long(1))
        ctypes.CDLL(None).srand(1)
        if library.espeak_SetVoiceByName(voice.encode()) != 0:
            raise ExplainedError(
                f"espeak-ng has no voice {voice!r}", remedy="name one such as en-us, it+f3 or de+m4"
            )
        library.espeak_SetParameter(_PARAMETER_RATE, words_per_minute, 0)
        library.espeak_SetParameter(_PARAMETER_PITCH, pitch, 0)
        sound, events = _collect(library, text)
        library.espeak_Terminate()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if not sound or not any(symbol for _, symbol in events):
        raise ExplainedError(f"no words in {text!r}", remedy="give a text with words")
    samples = np.frombuffer(bytes(sound), dtype=np.int16).astype(np.float32) / 32768.0
    return samples, rate, _phones(events, rate, len(samples))


def speak(text: str, voice: str, out_wav: Path) -> list[Phone]:
    """Writes a text as a 16 bit mono WAV file and returns its phones. See `synthesise`."""
    import soundfile

    samples, rate, phones = synthesise(text, voice)
    with atomic_path(out_wav) as temporary:
        soundfile.write(temporary, samples, rate, subtype="PCM_16", format="WAV")
    return phones


def _fresh_library() -> tuple[ctypes.CDLL, Path]:
    """A private copy of the library.

    espeak-ng keeps counters (flutter of the pitch) in static variables that no call resets, so the
    same text would sound different the second time.
    """
    folder = Path(tempfile.mkdtemp(prefix="espeak-"))
    source = Path(str(espeakng_loader.get_library_path()))
    copy = folder / source.name
    shutil.copyfile(source, copy)
    library = ctypes.CDLL(str(copy))
    return library, folder


def _collect(library: ctypes.CDLL, text: str) -> tuple[bytearray, list[tuple[int, str]]]:
    sound = bytearray()
    events: list[tuple[int, str]] = []

    def receive(wave: object, count: int, event: object) -> int:
        if wave and count > 0:
            sound.extend(ctypes.string_at(wave, 2 * count))  # type: ignore[arg-type]
        index = 0
        while event[index].type != 0:  # type: ignore[index]
            if event[index].type == _EVENT_PHONEME:  # type: ignore[index]
                symbol = event[index].id.string  # type: ignore[index]
                events.append((event[index].sample, symbol.decode(errors="ignore")))  # type: ignore[index]
            index += 1
        return 0

    callback = _CALLBACK(receive)
    library.espeak_SetSynthCallback(callback)
    spoken = text.encode()
    library.espeak_Synth(
        spoken, len(spoken) + 1, 0, _POSITION_CHARACTER, 0, _CHARS_UTF8, None, None
    )
    library.espeak_Synchronize()
    return sound, events


def _phones(events: list[tuple[int, str]], rate: int, samples: int) -> list[Phone]:
    """Events (sample, symbol) to phones that tile 0..samples; stress marks are dropped."""
    starts = [(0, "")] + [(s, "".join(c for c in p if c not in "ˈˌː")) for s, p in events]
    ends = [s for s, _ in starts[1:]] + [samples]
    return [
        Phone(symbol, start / rate, end / rate)
        for (start, symbol), end in zip(starts, ends, strict=True)
        if end > start
    ]
