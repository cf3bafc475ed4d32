"""Names and groups of the 478 FaceMesh points.

Indices are those of FaceMesh with refined irises. "Left" and "right" are the image's,
for a person who faces the camera.
"""

from __future__ import annotations

LANDMARKS = 478

LEFT_EYE_OUTER, RIGHT_EYE_OUTER = 33, 263
LEFT_EAR, RIGHT_EAR = 234, 454
FOREHEAD_TOP, CHIN = 10, 152
EYE_CORNERS = (33, 133, 362, 263)
NOSE_BRIDGE, NOSE_TIP, NOSE_BASE = 168, 4, 2

# Points that speech, blinks and brows do not move: forehead, temples, nose, cheek bones and eye
# corners. Poses are fitted to these alone.
RIGID: tuple[int, ...] = (
    *(10, 151, 9, 8, 168, 6, 197, 195, 5, 4, 1),
    *(109, 67, 103, 54, 21, 108, 69, 104, 68),
    *(338, 297, 332, 284, 251, 337, 299, 333, 298),
    *(45, 44, 220, 115, 131, 198, 236, 3, 51, 134, 196, 174, 122, 188, 193, 114, 217, 126, 209),
    *(275, 274, 440, 344, 360, 420, 456, 248, 281),
    *(363, 419, 399, 351, 412, 417, 343, 437, 355, 429),
    *(127, 34, 162, 139, 234, 227, 116, 117, 118, 119, 100, 101, 50, 36, 143, 156, 111),
    *(356, 264, 389, 368, 454, 447, 345, 346, 347, 348, 329, 330, 280, 266, 372, 383, 340),
    *EYE_CORNERS,  # stay last
)

# The nose below its bridge, whose outline is their convex hull.
NOSE: tuple[int, ...] = (6, 1, 4, 48, 64, 97, 98, 129, 278, 294, 326, 327, 358)

# Nose and cheeks, where hardly anybody has hair.
SKIN: tuple[int, ...] = (4, 5, 195, 197, 6, 50, 280, 205, 425, 101, 330, 36, 266)

# Outline of the skin that moves with the skull: temples, cheek bones, the nose. It ends above the
# upper lip and below the forehead, whose skin goes up and wrinkles with the brows.
UPPER_FACE: tuple[int, ...] = (
    *(8, 301, 368, 264, 447, 345, 330, 429, 278, 1),
    *(48, 209, 101, 116, 227, 34, 139, 71),
)

# Eyes with their brows: inside the upper face, yet they move by themselves.
LEFT_EYE_AND_BROW: tuple[int, ...] = (
    *(33, 7, 163, 144, 145, 153, 154, 155, 133, 173, 157, 158, 159, 160, 161, 246),
    *(70, 63, 105, 66, 107, 46, 53, 52, 65, 55),
)
RIGHT_EYE_AND_BROW: tuple[int, ...] = (
    *(263, 249, 390, 373, 374, 380, 381, 382, 362, 398, 384, 385, 386, 387, 388, 466),
    *(300, 293, 334, 296, 336, 276, 283, 282, 295, 285),
)

# The rims of the lids: the first points of the eyes above.
LEFT_LIDS, RIGHT_LIDS = LEFT_EYE_AND_BROW[:16], RIGHT_EYE_AND_BROW[:16]

# Outline of the brows, the forehead just above them, and the nose down to the end of its bridge.
BROWS_AND_BRIDGE: tuple[int, ...] = (
    *(68, 104, 69, 108, 151, 337, 299, 333, 298),
    *(301, 263, 5, 33, 71),
)

# Of a jaw that opens, by how much the chin goes back while it goes down: it hinges at the ears.
JAW_BACK = 0.8

# The jaw from one ear lobe to the other, left to right.
JAW: tuple[int, ...] = (
    *(132, 58, 172, 136, 150, 149, 176, 148, 152),
    *(377, 400, 378, 379, 365, 397, 288, 361),
)

# The outline of the whole face, for its box and its mask.
FACE_OVAL: tuple[int, ...] = (
    *(10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377),
    *(152, 148, 176, 149, 150, 136, 172, 58, 132, 93, 234, 127, 162, 21, 54, 103, 67, 109),
)
