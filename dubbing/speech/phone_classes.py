"""Phone classes: the outputs of the acoustic network, one alphabet for all languages.

A class is an IPA letter, or several that hardly differ for an ear or a lip.
"""

SILENCE = 0
# The letters of each class; class 0 is silence.
CLASSES = (
    *("", "p", "b", "m", "fɸ", "vʋɱβ", "tʈ", "dɖ", "nɳ", "sɕ", "zʑ", "ʃʂ", "ʒʐ", "kqcʔ", "gɡɟɢ"),
    *("ŋ", "θ", "ð", "hɦħʕ", "lɫɭ", "rɾʀʁɽ", "ɹɻ", "wʍɰ", "jʝ", "iɨɪ", "eɘ", "ɛ", "æ", "aɐ"),
    *("ɑɒ", "ɔ", "oɤ", "ʊ", "uɯʉ", "ʌ", "əɵ", "ɜɚɝ", "yʏɥ", "øœɶ", "xχçɣɧ", "ɲʎ"),
)
CLASS_OF = {letter: k for k, letters in enumerate(CLASSES) for letter in letters}
