"""A synthetic speaker: a rendered head whose mouth follows phones with known times.

It stands in for footage of people in the demo and the tests, and gives clips with exact truth:
head poses, mattes, mouth opening, phone times, A/V offset.
"""
