"""The form of `dfrf consent`: the keys of `consent` in a manifest, to be filled in by people."""

FORM = """\
# Consent to a dub, written by `dfrf consent`. Fill in every line, or delete those that shall not
# limit anything (`languages`, `until`, `films`). What is left blank is refused.
#
# "I agree that new speech is put into my mouth in the films named here, with pictures that a
# computer makes of my face, in these languages and until this day. I know that each result is
# marked as made so, and that I can withdraw my consent for everything that is still to be made."
#
# Let the person sign this text, and keep the signed copy where `reference` points. In the manifest:
#     consent: this-file.yaml
# The digest of this file stands in the record of every result.

by:           # first and last name of the person on film
date:         # the day on which they agreed, as 2026-11-02
reference:    # where the signed copy is kept: archive, folder, number
languages: [] # of the new speech, as [it, de, pt-BR]; each dub then names its `language`
until:        # the last day on which dubs may be made, as 2027-11-02
films: []     # files that may be dubbed, as [../clips/host.mp4], or their SHA-256
"""
